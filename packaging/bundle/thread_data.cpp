// The two functions behind boost::thread_specific_ptr, all that OpenImageIO wants of Boost's thread library: the distribution's
// archive of it is not made for shared objects.

#include <boost/thread/tss.hpp>
#include <map>

namespace {

struct Slot {
    boost::detail::thread::cleanup_caller_t caller;
    boost::detail::thread::cleanup_func_t function;
    void* data;

    void clean_up() const {
        if (function && data) caller(function, data);
    }
};

/// A thread's values, by the address of their owners.
struct Slots {
    std::map<const void*, Slot> by_key;

    /// At the end of the thread. Cleaning up may set others.
    ~Slots() {
        while (!by_key.empty()) {
            const Slot slot = by_key.begin()->second;
            by_key.erase(by_key.begin());
            slot.clean_up();
        }
    }
};

thread_local Slots slots;

}  // namespace

namespace boost::detail {

void* get_tss_data(const void* key) {
    const auto found = slots.by_key.find(key);
    return found == slots.by_key.end() ? nullptr : found->second.data;
}

void set_tss_data(const void* key, thread::cleanup_caller_t caller, thread::cleanup_func_t function, void* data, bool clean_up_old) {
    if (const auto found = slots.by_key.find(key); found != slots.by_key.end()) {
        const Slot old = found->second;
        slots.by_key.erase(found);
        if (clean_up_old) old.clean_up();
    }
    if (function || data) slots.by_key[key] = {caller, function, data};
}

}  // namespace boost::detail
