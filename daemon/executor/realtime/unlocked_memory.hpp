/// @file
/// Memory outside of what is locked for the loop: for bytes whose number others decide, such as
/// messages from and for the network. One bounded pool for the process, as locking is.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

namespace rtcf::executor {

/// Blocks that are used again and not given back, as the kernel interrupts the loop's CPU when a
/// process unmaps memory. Any thread that is not real-time.
class UnlockedMemory {
   public:
    /// Bytes of all blocks together.
    static constexpr std::size_t kMost = 192U * 1024 * 1024;

    /// The process's, which locks its memory as a whole.
    static UnlockedMemory& ofProcess();

    /// @return null if there is no room for so many bytes now
    std::shared_ptr<std::uint8_t[]> allocate(std::size_t bytes);

    /// To be called after each mlockall(), which locks these too.
    void unlock();

    /// Bytes of the blocks that are in use.
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

    mutable std::mutex mutex_;  // all below
    std::array<std::vector<std::uint8_t*>, kSizes> free_;
    std::vector<std::pair<std::uint8_t*, std::size_t>> mapped_;
    std::size_t mapped_bytes_ = 0;
    std::size_t used_bytes_ = 0;
};

}  // namespace rtcf::executor
