/// @file
/// The memory of the loop's frames: a file that rtcfd opens too, so that it can read the last
/// cycles after any end of the process. A block contains the ring of one graph. After a change of
/// the graph, the block stays as long as there is room, so that the cycles before the change can be
/// read. executor.proto defines the layout. Owned by the runner; graph thread.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace rtcf::executor {

/// Zeroed words of the file, mapped for the life of the object.
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
    static constexpr std::size_t kRings = 8;  ///< rings kept, including the one in use
    /// Most bytes of all blocks.
    static constexpr std::size_t kMost = std::size_t{36} * 1024 * 1024;

    /// @throws std::system_error if there is no memory for it
    FrameMemory();
    ~FrameMemory();
    FrameMemory(const FrameMemory&) = delete;
    FrameMemory& operator=(const FrameMemory&) = delete;

    /// The descriptor that rtcfd opens by /proc.
    int fd() const noexcept { return fd_; }

    /// Allocates a block for a ring. Removes the oldest unused rings if necessary.
    /// @return null if blocks in use take all the room, or the system has no memory
    std::shared_ptr<FrameBlock> take(std::size_t bytes);
    /// Adds a block to the file's directory, before its ring is filled.
    /// @param layout a serialised FrameLayout
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
    std::uint64_t end_ = 0;       // size of the file, bytes
    std::size_t bytes_ = 0;       // size of all blocks, bytes
    std::uint64_t sequence_ = 0;  // sequence number of the last ring
    std::vector<Ring> rings_;     // oldest first
    std::vector<std::shared_ptr<FrameBlock>> free_;
};

}  // namespace rtcf::executor
