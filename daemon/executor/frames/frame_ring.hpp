/// @file
/// The values of every cycle: at its end the real-time thread copies them, with the cycle's
/// record, into a ring. One writer, any number of readers, none of whom it waits
/// for or knows of: a reader that is late finds its frame gone, and one that is being written is
/// recognised. Words are atomic and ordered by release and acquire alone, which costs nothing on
/// x86-64.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "frames/cycle_record.hpp"
#include "frames/frame_memory.hpp"
#include "rtcf/realtime.hpp"

namespace rtcf::executor {

/// One frame, as a reader has copied it.
class Frame {
   public:
    const CycleRecord& cycle() const noexcept { return cycle_; }
    bool lastOfLoop() const noexcept { return last_of_loop_; }
    /// The values, each at the offset that FrameRing::offset() tells.
    const std::uint8_t* values() const noexcept {
        return reinterpret_cast<const std::uint8_t*>(words_.data());
    }

   private:
    friend class FrameRing;
    CycleRecord cycle_{};
    bool last_of_loop_ = false;
    std::vector<std::uint64_t> words_;
};

class FrameRing {
   public:
    /// A value to copy, of a size that stays.
    struct Source {
        const void* from;
        std::size_t size;  ///< bytes
        friend bool operator==(const Source& a, const Source& b) noexcept {
            return a.from == b.from && a.size == b.size;
        }
    };

    /// @param frames how many the ring is to hold; fewer where they would take more than
    ///               kLargestRing
    /// @param memory for a ring that is to outlive the process; null = any. Where that has no room,
    ///               it is any, too
    FrameRing(std::vector<Source> sources, std::size_t frames, FrameMemory* memory = nullptr);
    FrameRing(const FrameRing&) = delete;
    FrameRing& operator=(const FrameRing&) = delete;

    static constexpr std::size_t kLargestRing = std::size_t{16} * 1024 * 1024;  ///< bytes, locked
    static constexpr std::size_t kFewestFrames = 16;

    /// @name Whoever runs cycles; real-time safe
    /// @{
    /// Copies the values into the next frame, which no reader has before commit().
    void take() noexcept RTCF_NONBLOCKING;
    void commit(const CycleRecord& cycle, bool last_of_loop) noexcept RTCF_NONBLOCKING;
    /// @}

    /// @name Any thread
    /// @{
    const std::vector<Source>& sources() const noexcept { return sources_; }
    /// Where a source's value lies in a frame, bytes.
    std::size_t offset(std::size_t source) const noexcept { return offsets_[source]; }
    std::size_t capacity() const noexcept { return mask_ + 1; }
    /// Words of a frame, and the block that they lie in; null = it goes with the process.
    std::size_t wordsOfFrame() const noexcept { return stride_; }
    const std::shared_ptr<FrameBlock>& block() const noexcept { return block_; }
    /// How many frames a ring of such sources holds.
    static std::size_t capacityFor(const std::vector<Source>& sources, std::size_t frames) noexcept;
    /// Number of the next frame: those from 0 up to it have been committed.
    std::uint64_t end() const noexcept { return end_.load(std::memory_order_acquire); }
    /// Copies a committed frame. @return false if it is not there any more
    bool read(std::uint64_t number, Frame& frame) const;
    /// The readers have all frames below this one. @param next UINT64_MAX = there are none
    void setTaken(std::uint64_t next) noexcept { taken_.store(next, std::memory_order_release); }
    /// How many frames a reader has yet to take.
    std::uint64_t waiting() const noexcept {
        const std::uint64_t taken = taken_.load(std::memory_order_acquire);
        return end() > taken ? end() - taken : 0;
    }
    /// @}

   private:
    using Word = FrameBlock::Word;
    // A frame begins with these words. The first one is twice its number plus 1 while it is
    // written, plus 2 once it is whole.
    enum Head : std::size_t { kMark, kIteration, kStamp, kLatency, kDuration, kLast, kHeadWords };

    Word* at(std::uint64_t number) const noexcept { return words_ + (number & mask_) * stride_; }

    std::vector<Source> sources_;
    std::vector<std::size_t> offsets_;
    std::size_t stride_ = kHeadWords;  // words of a frame
    std::size_t mask_ = 0;             // frames minus 1
    std::shared_ptr<FrameBlock> block_;
    std::unique_ptr<Word[]> own_;  // NOLINT(modernize-avoid-c-arrays): without a block
    Word* words_ = nullptr;
    std::uint64_t next_ = 0;  // of the writer
    std::atomic<std::uint64_t> end_{0};
    std::atomic<std::uint64_t> taken_{UINT64_MAX};
};

}  // namespace rtcf::executor
