/// @file
/// Memory that is not locked, for data whose size others decide, such as messages from and for the
/// network. One bounded pool per process, because locking is per process.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

namespace rtcf::executor {

/// Blocks are reused and not unmapped, because the kernel interrupts the loop's CPU when a process
/// unmaps memory. Any thread that is not real-time.
class UnlockedMemory {
   public:
    /// Limit of all blocks together, bytes.
    static constexpr std::size_t kMost = 192U * 1024 * 1024;

    /// The pool of the process.
    static UnlockedMemory& ofProcess();

    /// Allocates a block, which the shared pointer gives back.
    /// @return null if the pool has no room
    std::shared_ptr<std::uint8_t[]> allocate(std::size_t bytes);

    /// Unlocks all blocks. Must be called after each mlockall(), which locks them.
    void unlock();

    /// Size of the blocks in use, bytes.
    std::size_t used() const;

   private:
    // Block sizes are powers of two, from this one on.
    static constexpr std::size_t kSmallest = 4096;
    static constexpr std::size_t kSizes = 20;

    static std::size_t sizeOf(std::size_t index) { return kSmallest << index; }
    std::uint8_t* take(std::size_t index);
    void giveBack(std::uint8_t* block, std::size_t index);
    std::uint8_t* map(std::size_t bytes);
    void makeRoom(std::size_t bytes);

    mutable std::mutex mutex_;  // protects all members below
    std::array<std::vector<std::uint8_t*>, kSizes> free_;
    std::vector<std::pair<std::uint8_t*, std::size_t>> mapped_;
    std::size_t mapped_bytes_ = 0;
    std::size_t used_bytes_ = 0;
};

}  // namespace rtcf::executor
