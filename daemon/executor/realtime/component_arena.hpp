/// @file
/// The memory of components and of their outputs' values. One per process: a value may outlive its
/// component and its runner's graph.
#pragma once

#include <cstddef>
#include <map>
#include <mutex>
#include <utility>
#include <vector>

#include "rtcf/component_memory.hpp"

namespace rtcf::executor {

/// Takes blocks one after another from large chunks. A free block is used again for a block of the
/// same size, and is never returned to the system: components of the same types come and go. The
/// free block with the lowest address comes first, so that blocks that are allocated one after
/// another lie in the order of their addresses also where others were before.
/// Without huge pages, because the kernel may stop the loop while it makes one of locked memory.
class ComponentArena final : public ComponentMemory {
   public:
    /// Larger blocks are on the heap.
    static constexpr std::size_t kLargest = 16384;                  // bytes
    static constexpr std::size_t kChunk = std::size_t{128} * 1024;  // bytes

    ComponentArena() = default;
    /// Frees all chunks. After all their blocks.
    ~ComponentArena();

    /// The arena of the process; null if a sanitizer has to see each block.
    static ComponentArena* ofProcess();

    void* allocate(std::size_t size, std::size_t alignment) override;
    void release(void* block, std::size_t size, std::size_t alignment) noexcept override;

   private:
    struct Free {
        Free* next;
    };
    struct FreeBlocks {
        Free* first = nullptr;
        bool sorted = true;
    };
    using Kind = std::pair<std::size_t, std::size_t>;  // size and alignment
    static Kind kindOf(std::size_t size, std::size_t alignment) noexcept;
    static bool isLarge(const Kind& kind) noexcept;
    static void sort(FreeBlocks& free);
    void addChunk();

    std::mutex mutex_;  // protects all members below
    std::map<Kind, FreeBlocks> free_;
    std::vector<void*> chunks_;
    std::byte* next_ = nullptr;  // of the last chunk
    std::byte* end_ = nullptr;
};

}  // namespace rtcf::executor
