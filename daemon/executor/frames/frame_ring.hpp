/// @file
/// The ring of frames. At the end of each cycle, the real-time thread copies the cycle's record and
/// values into the next frame. There is one writer and any number of readers; the writer does not
/// know the readers and never waits for them. A late reader finds its frame overwritten, and
/// detects a frame that is being written. Words are atomic, with release and acquire order, which
/// costs nothing on x86-64.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "frames/cycle_record.hpp"
#include "frames/frame_copy.hpp"
#include "frames/frame_memory.hpp"
#include "rtcf/realtime.hpp"

namespace rtcf::executor {

/// A reader's copy of one frame.
class Frame {
   public:
    const CycleRecord& cycle() const noexcept { return cycle_; }
    bool lastOfLoop() const noexcept { return last_of_loop_; }
    /// The values, each at its FrameRing::offset().
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
    using Source = FrameCopy::Source;

    /// @param frames wanted capacity; reduced if the ring would exceed kLargestRing
    /// @param memory memory for a ring that outlives the process; null, or memory without room: the
    /// ring is in the process's own memory
    FrameRing(std::vector<Source> sources, std::size_t frames, FrameMemory* memory = nullptr);
    FrameRing(const FrameRing&) = delete;
    FrameRing& operator=(const FrameRing&) = delete;

    /// Bytes; locked memory.
    static constexpr std::size_t kLargestRing = std::size_t{16} * 1024 * 1024;
    static constexpr std::size_t kFewestFrames = 16;

    /// @name Cycle thread; real-time safe
    /// @{
    /// Copies the values into the next frame. Readers cannot read it before commit().
    void take() noexcept RTCF_NONBLOCKING {
        Word* const frame = writing_;
        frame[kMark].store(2 * end_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
        copy_.copy(frame + kHeadWords);
    }
    /// Records the present values after they were changed outside of a cycle, for putBack().
    void setBase() noexcept RTCF_NONBLOCKING {
        copy_.copy(base_.get());
        base_end_ = end_.load(std::memory_order_relaxed);
    }
    /// Restores the value of a source from the last frame or setBase(). Does nothing if `value` is
    /// not a source.
    /// @param value address of the source's value
    void putBack(void* value) const noexcept RTCF_NONBLOCKING;
    /// Adds the cycle's record and makes the frame readable.
    void commit(const CycleRecord& cycle, bool last_of_loop) noexcept RTCF_NONBLOCKING {
        const auto put = [frame = writing_](Head place, std::uint64_t value) {
            frame[place].store(value, std::memory_order_release);
        };
        put(kIteration, cycle.iteration);
        put(kStamp, static_cast<std::uint64_t>(cycle.stamp_ns));
        put(kLatency, static_cast<std::uint64_t>(cycle.latency_ns));
        put(kDuration, static_cast<std::uint64_t>(cycle.duration_ns));
        put(kLast, last_of_loop ? 1 : 0);
        const std::uint64_t next = end_.load(std::memory_order_relaxed) + 1;
        put(kMark, 2 * next);
        writing_ = (next & mask_) != 0 ? writing_ + stride_ : words_;
        end_.store(next, std::memory_order_release);
    }
    /// @}

    /// @name Any thread
    /// @{
    const std::vector<Source>& sources() const noexcept { return copy_.sources(); }
    /// Offset of a source's value among a frame's values, bytes.
    std::size_t offset(std::size_t source) const noexcept { return copy_.offset(source); }
    std::size_t capacity() const noexcept { return mask_ + 1; }
    /// Size of a frame, words.
    std::size_t wordsOfFrame() const noexcept { return stride_; }
    /// Size of a frame's values, which follow its header, words.
    std::size_t wordsOfValues() const noexcept { return copy_.words(); }
    /// The memory of the ring; null = the process's own memory.
    const std::shared_ptr<FrameBlock>& block() const noexcept { return block_; }
    /// Capacity of a ring of these sources, frames.
    static std::size_t capacityFor(const std::vector<Source>& sources, std::size_t frames);
    /// Number of the next frame; all smaller numbers have been committed.
    std::uint64_t end() const noexcept { return end_.load(std::memory_order_acquire); }
    /// Copies a committed frame.
    /// @return false if it has been overwritten
    bool read(std::uint64_t number, Frame& frame) const;
    /// Notes that the readers have taken all frames below `next`.
    /// @param next UINT64_MAX = there are no readers
    void setTaken(std::uint64_t next) noexcept { taken_.store(next, std::memory_order_release); }
    /// Number of frames that the slowest reader has yet to take.
    std::uint64_t waiting() const noexcept {
        const std::uint64_t taken = taken_.load(std::memory_order_acquire);
        return end() > taken ? end() - taken : 0;
    }
    /// @}

   private:
    using Word = FrameBlock::Word;
    // Header of a frame, in words. kMark is 2 * number + 1 while the frame is being written, and 2
    // * number + 2 when it is complete.
    enum Head : std::size_t { kMark, kIteration, kStamp, kLatency, kDuration, kLast, kHeadWords };

    Word* at(std::uint64_t number) const noexcept { return words_ + (number & mask_) * stride_; }

    FrameCopy copy_;
    std::size_t stride_;  // size of a frame, words
    std::size_t mask_;    // capacity minus 1
    std::shared_ptr<FrameBlock> block_;
    std::unique_ptr<Word[]> own_;  // NOLINT(modernize-avoid-c-arrays): if there is no block
    // Values of setBase(); for the writer only.
    std::unique_ptr<Word[]> base_;  // NOLINT(modernize-avoid-c-arrays)
    std::uint64_t base_end_ = 0;    // end_ at the last setBase()
    Word* words_ = nullptr;
    Word* writing_;  // the next frame; for the writer only
    std::atomic<std::uint64_t> end_{0};
    std::atomic<std::uint64_t> taken_{UINT64_MAX};
};

}  // namespace rtcf::executor
