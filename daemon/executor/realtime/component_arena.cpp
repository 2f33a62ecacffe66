#include "realtime/component_arena.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <new>

namespace rtcf::executor {

ComponentArena* ComponentArena::ofProcess() {
#if defined(__SANITIZE_ADDRESS__)
    return nullptr;
#else
    static auto* const arena = new ComponentArena;  // never destroyed: values refer to it
    return arena;
#endif
}

void* ComponentArena::allocate(std::size_t size, std::size_t alignment) {
    size = std::max(size, sizeof(Free));
    alignment = std::max(alignment, alignof(Free));
    if (size > kLargest || alignment > kLargest)
        return ::operator new(size, static_cast<std::align_val_t>(alignment));
    const std::lock_guard<std::mutex> lock(mutex_);
    Free*& free = free_[{size, alignment}];  // so that release() allocates nothing
    if (free != nullptr) {
        Free* const block = free;
        free = block->next;
        return block;
    }
    const auto aligned = [&] {
        return next_ + (-reinterpret_cast<std::uintptr_t>(next_) & (alignment - 1));
    };
    if (next_ == nullptr || aligned() > end_ || size > static_cast<std::size_t>(end_ - aligned()))
        addChunk();
    std::byte* const block = aligned();
    next_ = block + size;
    return block;
}

void ComponentArena::release(void* block, std::size_t size, std::size_t alignment) noexcept {
    size = std::max(size, sizeof(Free));
    alignment = std::max(alignment, alignof(Free));
    if (size > kLargest || alignment > kLargest) {
        ::operator delete(block, static_cast<std::align_val_t>(alignment));
        return;
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    Free*& free = free_.find({size, alignment})->second;
    free = new (block) Free{free};
}

// The rest of the present chunk is lost.
void ComponentArena::addChunk() {
    const std::size_t size = next_ == nullptr ? kFirstChunk : kChunk;
    void* const chunk = std::aligned_alloc(size, size);
    if (chunk == nullptr) throw std::bad_alloc();
    if (size == kChunk) madvise(chunk, size, MADV_HUGEPAGE);
    next_ = static_cast<std::byte*>(chunk);
    end_ = next_ + size;
}

}  // namespace rtcf::executor
