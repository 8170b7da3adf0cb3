/// A worker's memory for columns: one block, taken once, carved into 64-byte aligned pieces, never freed piecewise.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>

namespace talbot {

class Arena {
public:
    explicit Arena(size_t bytes);
    /// Uninitialised room for n values. Throws std::bad_alloc when the arena is full: sizes are known at start.
    template <class T>
    T* take(size_t n) {
        return static_cast<T*>(take_bytes(n * sizeof(T)));
    }
    size_t used() const { return used_; }
    void reset() { used_ = 0; }

private:
    void* take_bytes(size_t bytes);
    struct Free {
        void operator()(void* p) const { std::free(p); }
    };
    std::unique_ptr<std::byte, Free> memory_;
    size_t size_ = 0;
    size_t used_ = 0;
};

}  // namespace talbot
