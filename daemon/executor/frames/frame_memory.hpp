/// @file
/// The memory of the loop's frames: a file that rtcfd opens too, so that it can read the last
/// cycles after any death of the process. A block holds the ring of one graph, and after a change
/// stays as long as there is room: what ran just before the change is known, too. Its layout is
/// fixed in executor.proto. Owned by the runner; graph thread.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace rtcf::executor {

/// Zeroed words of the file, mapped as long as somebody has the block.
class FrameBlock {
   public:
    using Word = std::atomic<std::uint64_t>;

    /// @throws std::system_error if there is no memory for it
    FrameBlock(int fd, std::uint64_t offset, std::size_t bytes);
    ~FrameBlock();
    FrameBlock(const FrameBlock&) = delete;
    FrameBlock& operator=(const FrameBlock&) = delete;

    Word* words() const noexcept { return words_; }
    std::uint64_t offset() const noexcept { return offset_; }
    std::size_t bytes() const noexcept { return bytes_; }
    void clear() noexcept;

   private:
    Word* words_;
    std::uint64_t offset_;
    std::size_t bytes_;
};

class FrameMemory {
   public:
    static constexpr std::size_t kRings = 8;  ///< that are kept, the one in use among them
    static constexpr std::size_t kMost = std::size_t{36} * 1024 * 1024;  ///< bytes of all blocks

    /// @throws std::system_error if there is no memory for it
    FrameMemory();
    ~FrameMemory();
    FrameMemory(const FrameMemory&) = delete;
    FrameMemory& operator=(const FrameMemory&) = delete;

    /// The descriptor that rtcfd opens by /proc.
    int fd() const noexcept { return fd_; }

    /// A block for a ring; the oldest ones that nobody fills or reads make room for it.
    /// @return null if others take all the room, or the system has none
    std::shared_ptr<FrameBlock> take(std::size_t bytes);
    /// Makes a block known to who reads the file; before its ring is filled.
    /// @param layout a FrameLayout, serialised
    void announce(const std::shared_ptr<FrameBlock>& block, std::size_t frames,
                  std::size_t words_of_frame, const std::string& layout);

   private:
    struct Directory;
    struct Ring {
        std::shared_ptr<FrameBlock> block;
        std::shared_ptr<FrameBlock> layout;
        std::size_t entry;
    };

    std::shared_ptr<FrameBlock> block(std::size_t bytes);
    bool forgetOldest();

    int fd_ = -1;
    Directory* directory_ = nullptr;
    std::uint64_t end_ = 0;       // of the file
    std::size_t bytes_ = 0;       // of all blocks
    std::uint64_t sequence_ = 0;  // of the last ring
    std::vector<Ring> rings_;     // from the oldest on
    std::vector<std::shared_ptr<FrameBlock>> free_;
};

}  // namespace rtcf::executor
