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
#include "frames/frame_copy.hpp"
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
    using Source = FrameCopy::Source;

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
    void take() noexcept RTCF_NONBLOCKING {
        Word* const frame = writing_;
        frame[kMark].store(2 * end_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
        copy_.copy(frame + kHeadWords);
    }
    /// Notes the values as they are, where they were changed otherwise than by a cycle.
    void setBase() noexcept RTCF_NONBLOCKING {
        copy_.copy(base_.get());
        base_end_ = end_.load(std::memory_order_relaxed);
    }
    /// Gives a source the value that it had after the last frame or setBase(). @param value where
    /// a source lies; other addresses are left alone
    void putBack(void* value) const noexcept RTCF_NONBLOCKING;
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
    /// Where a source's value lies in a frame, bytes.
    std::size_t offset(std::size_t source) const noexcept { return copy_.offset(source); }
    std::size_t capacity() const noexcept { return mask_ + 1; }
    /// Words of a frame, those of its values, which are its last, and the block that frames lie
    /// in; null = it goes with the process.
    std::size_t wordsOfFrame() const noexcept { return stride_; }
    std::size_t wordsOfValues() const noexcept { return copy_.words(); }
    const std::shared_ptr<FrameBlock>& block() const noexcept { return block_; }
    /// How many frames a ring of such sources holds.
    static std::size_t capacityFor(const std::vector<Source>& sources, std::size_t frames);
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

    FrameCopy copy_;
    std::size_t stride_;  // words of a frame
    std::size_t mask_;    // frames minus 1
    std::shared_ptr<FrameBlock> block_;
    std::unique_ptr<Word[]> own_;   // NOLINT(modernize-avoid-c-arrays): without a block
    std::unique_ptr<Word[]> base_;  // NOLINT(modernize-avoid-c-arrays): values; of the writer
    std::uint64_t base_end_ = 0;    // end_ at the last setBase()
    Word* words_ = nullptr;
    Word* writing_;  // the writer's: its next frame
    std::atomic<std::uint64_t> end_{0};
    std::atomic<std::uint64_t> taken_{UINT64_MAX};
};

}  // namespace rtcf::executor
