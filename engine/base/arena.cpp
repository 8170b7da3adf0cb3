#include "base/arena.h"

#include <new>

namespace talbot {

Arena::Arena(size_t bytes) : size_((bytes + 63) & ~size_t(63)) {
    memory_.reset(static_cast<std::byte*>(std::aligned_alloc(64, size_ ? size_ : 64)));
    if (!memory_) throw std::bad_alloc();
}

void* Arena::take_bytes(size_t bytes) {
    // One extra cache line staggers columns: equal offsets in many power-of-two columns would share cache sets.
    const size_t rounded = ((bytes + 63) & ~size_t(63)) + 64;
    if (used_ + rounded > size_) throw std::bad_alloc();
    void* p = memory_.get() + used_;
    used_ += rounded;
    return p;
}

}  // namespace talbot
