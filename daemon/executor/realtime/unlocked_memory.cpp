#include "realtime/unlocked_memory.hpp"

#include <sys/mman.h>

#include <algorithm>

namespace rtcf::executor {

UnlockedMemory& UnlockedMemory::ofProcess() {
    // Never destroyed, because threads of libraries hold blocks until the end of the process.
    static auto& memory = *new UnlockedMemory;  // NOLINT(cppcoreguidelines-owning-memory)
    return memory;
}

std::shared_ptr<std::uint8_t[]> UnlockedMemory::allocate(std::size_t bytes) {
    std::size_t index = 0;
    while (index < kSizes && sizeOf(index) < bytes) ++index;
    if (index == kSizes) return nullptr;
    std::uint8_t* block = nullptr;
    {
        const std::lock_guard lock(mutex_);
        block = take(index);
        if (block == nullptr) return nullptr;
        used_bytes_ += sizeOf(index);
    }
    return {block, [this, index](std::uint8_t* used) { giveBack(used, index); }};
}

void UnlockedMemory::unlock() {
    const std::lock_guard lock(mutex_);
    for (const auto& [block, bytes] : mapped_) munlock(block, bytes);
}

std::size_t UnlockedMemory::used() const {
    const std::lock_guard lock(mutex_);
    return used_bytes_;
}

std::uint8_t* UnlockedMemory::take(std::size_t index) {
    if (!free_[index].empty()) {
        std::uint8_t* block = free_[index].back();
        free_[index].pop_back();
        return block;
    }
    const std::size_t bytes = sizeOf(index);
    if (mapped_bytes_ + bytes > kMost) makeRoom(bytes);
    return mapped_bytes_ + bytes > kMost ? nullptr : map(bytes);
}

void UnlockedMemory::giveBack(std::uint8_t* block, std::size_t index) {
    const std::lock_guard lock(mutex_);
    free_[index].push_back(block);
    used_bytes_ -= sizeOf(index);
}

std::uint8_t* UnlockedMemory::map(std::size_t bytes) {
    // PROT_NONE: otherwise mmap() would populate the pages, because the process locks future
    // memory.
    void* block =
        mmap(nullptr, bytes, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (block == MAP_FAILED) return nullptr;
    munlock(block, bytes);
    if (mprotect(block, bytes, PROT_READ | PROT_WRITE) != 0) {
        munmap(block, bytes);
        return nullptr;
    }
    mapped_bytes_ += bytes;
    mapped_.emplace_back(static_cast<std::uint8_t*>(block), bytes);
    return mapped_.back().first;
}

// Unmaps free blocks of other sizes, largest first.
void UnlockedMemory::makeRoom(std::size_t bytes) {
    for (std::size_t index = kSizes; index-- > 0;) {
        while (!free_[index].empty() && mapped_bytes_ + bytes > kMost) {
            std::uint8_t* block = free_[index].back();
            free_[index].pop_back();
            munmap(block, sizeOf(index));
            mapped_bytes_ -= sizeOf(index);
            mapped_.erase(
                std::find(mapped_.begin(), mapped_.end(), std::pair{block, sizeOf(index)}));
        }
    }
}

}  // namespace rtcf::executor
