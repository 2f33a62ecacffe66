#include "realtime/component_arena.hpp"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <new>
#include <vector>

namespace rtcf::executor {

ComponentArena::~ComponentArena() {
    for (void* chunk : chunks_) std::free(chunk);
}

ComponentArena* ComponentArena::ofProcess() {
#if defined(__SANITIZE_ADDRESS__)
    return nullptr;
#else
    static auto* const arena = new ComponentArena;  // never destroyed: values refer to it
    return arena;
#endif
}

// Sizes of large blocks are rounded, so that edited components find blocks of their predecessors.
ComponentArena::Kind ComponentArena::kindOf(std::size_t size, std::size_t alignment) noexcept {
    constexpr std::size_t kExact = 256;
    constexpr std::size_t kStep = 64;
    size = std::max(size, sizeof(Free));
    if (size > kExact) size = (size + kStep - 1) / kStep * kStep;
    return {size, std::max(alignment, alignof(Free))};
}

bool ComponentArena::isLarge(const Kind& kind) noexcept {
    return kind.first > kLargest || kind.second > kLargest;
}

void* ComponentArena::allocate(std::size_t size, std::size_t alignment) {
    const Kind kind = kindOf(size, alignment);
    if (isLarge(kind)) return ::operator new(size, static_cast<std::align_val_t>(alignment));
    const std::lock_guard<std::mutex> lock(mutex_);
    FreeBlocks& free = free_[kind];  // so that release() allocates nothing
    if (free.first != nullptr) {
        if (!free.sorted) sort(free);
        Free* const block = free.first;
        free.first = block->next;
        return block;
    }
    const auto aligned = [&] {
        return next_ + (-reinterpret_cast<std::uintptr_t>(next_) & (kind.second - 1));
    };
    if (next_ == nullptr || aligned() > end_ ||
        kind.first > static_cast<std::size_t>(end_ - aligned()))
        addChunk();
    std::byte* const block = aligned();
    next_ = block + kind.first;
    return block;
}

void ComponentArena::release(void* block, std::size_t size, std::size_t alignment) noexcept {
    const Kind kind = kindOf(size, alignment);
    if (isLarge(kind)) {
        ::operator delete(block, static_cast<std::align_val_t>(alignment));
        return;
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    FreeBlocks& free = free_.find(kind)->second;
    Free* const next = free.first;
    free.first = ::new (block) Free{next};
    free.sorted = next == nullptr || (free.sorted && std::less<>()(free.first, next));
}

void ComponentArena::sort(FreeBlocks& free) {
    std::vector<Free*> blocks;
    for (Free* block = free.first; block != nullptr; block = block->next) blocks.push_back(block);
    std::sort(blocks.begin(), blocks.end(), std::less<>());
    free.first = nullptr;
    for (auto block = blocks.rbegin(); block != blocks.rend(); ++block) {
        (*block)->next = free.first;
        free.first = *block;
    }
    free.sorted = true;
}

// The rest of the last chunk is lost.
void ComponentArena::addChunk() {
    chunks_.reserve(chunks_.size() + 1);
    void* const chunk = std::aligned_alloc(kLargest, kChunk);
    if (chunk == nullptr) throw std::bad_alloc();
    chunks_.push_back(chunk);
    next_ = static_cast<std::byte*>(chunk);
    end_ = next_ + kChunk;
}

}  // namespace rtcf::executor
