/// @file
/// The ring of frames: the record of each cycle. At the start of a cycle, the real-time thread
/// begins the next frame; it notes the end of each component's update() there, and adds the values
/// and the cycle's times at the end. There is one writer and any number of readers; the writer does
/// not know the readers and never waits for them. A late reader finds its frame overwritten, and
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
#include "realtime/cycle_counter.hpp"
#include "rtcf/realtime.hpp"
#include "rtcf/slot.hpp"

namespace rtcf::executor {

/// Kinds of cycles. Numbers as in executor.proto.
enum class FrameKind : std::uint64_t { Counted = 0, LastOfLoop = 1, WarmUp = 2 };

/// The parts of a frame that are known at the start of its cycle.
struct FrameHead {
    std::uint64_t iteration;
    std::int64_t stamp_ns;
    std::int64_t latency_ns;
    std::int64_t begin_ticks;  ///< the end of the wait
    std::int64_t ready_ticks;  ///< the start of the first component
    FrameKind kind = FrameKind::Counted;
    /// The values were restored since the cycle before, so that stamps do not tell which are new.
    bool restored = false;
};

/// Times of a cycle, ticks of the cycle counter. All 0 in the last frame of a loop.
struct CycleTicks {
    std::int64_t begin;  ///< the end of the wait
    std::int64_t ready;  ///< the start of the first component, after the exchange of values
    std::int64_t end;
};

/// A reader's copy of one frame.
class Frame {
   public:
    const CycleRecord& cycle() const noexcept { return cycle_; }
    bool lastOfLoop() const noexcept { return kind_ == FrameKind::LastOfLoop; }
    /// True if statistics include the cycle: it is neither the last one nor of the warm-up.
    bool counted() const noexcept { return kind_ == FrameKind::Counted; }
    const CycleTicks& ticks() const noexcept { return ticks_; }
    /// Ends of the components' update(), in the order of the schedule; 0 = did not run.
    const std::uint64_t* ended() const noexcept { return words_.data(); }
    /// The values, each at its FrameRing::offset(). Not after FrameRing::readTicks().
    const std::uint8_t* values() const noexcept {
        return reinterpret_cast<const std::uint8_t*>(words_.data() + steps_);
    }

   private:
    friend class FrameRing;
    CycleRecord cycle_{};
    CycleTicks ticks_{};
    FrameKind kind_ = FrameKind::Counted;
    std::size_t steps_ = 0;
    std::vector<std::uint64_t> words_;
};

class FrameRing {
   public:
    using Source = FrameCopy::Source;
    using Word = FrameBlock::Word;

    /// @param steps   number of components that note their end
    /// @param frames  wanted capacity; reduced if the ring would exceed kLargestRing
    /// @param counter of the ticks
    /// @param memory memory for a ring that outlives the process; null, or memory without room: the
    /// ring is in the process's own memory
    FrameRing(std::vector<Source> sources, std::size_t steps, std::size_t frames,
              const CycleCounter& counter, FrameMemory* memory = nullptr);
    FrameRing(const FrameRing&) = delete;
    FrameRing& operator=(const FrameRing&) = delete;

    /// Bytes; locked memory.
    static constexpr std::size_t kLargestRing = std::size_t{16} * 1024 * 1024;
    static constexpr std::size_t kFewestFrames = 16;

    /// @name Cycle thread; real-time safe
    /// @{
    /// Begins the next frame. Readers cannot read it before commit().
    /// @return the words for the end of each component's update(), ticks; 0 = did not run
    [[gnu::always_inline]] Word* begin(const FrameHead& head) noexcept RTCF_NONBLOCKING {
        Word* const frame = writing_;
        frame[kMark].store(2 * end_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
        put(frame[kIteration], head.iteration);
        put(frame[kStamp], head.stamp_ns);
        put(frame[kLatency], head.latency_ns);
        put(frame[kKind], static_cast<std::uint64_t>(head.kind) | (head.restored ? kRestored : 0));
        put(frame[kBegin], head.begin_ticks);
        put(frame[kReady], head.ready_ticks);
        return frame + kHeadWords;
    }
    /// The words of begin() until commit().
    const Word* ended() const noexcept RTCF_NONBLOCKING { return writing_ + kHeadWords; }
    /// Copies the values into the frame.
    void take() noexcept RTCF_NONBLOCKING { copy_.copy(writing_ + kHeadWords + steps_); }
    /// Records the present values after they were changed outside of a cycle, for putBack().
    void setBase() noexcept RTCF_NONBLOCKING {
        copy_.copy(base_.get());
        base_end_ = end_.load(std::memory_order_relaxed);
    }
    /// Restores a source from the last frame or setBase(). Does nothing if `from` is not a source.
    void putBack(void* from) const noexcept RTCF_NONBLOCKING;
    /// Adds the end of the cycle and makes the frame readable.
    [[gnu::always_inline]] void commit(std::int64_t end_ticks) noexcept RTCF_NONBLOCKING {
        Word* const frame = writing_;
        const std::uint64_t next = end_.load(std::memory_order_relaxed) + 1;
        put(frame[kEnd], end_ticks);
        put(frame[kMark], 2 * next);
        writing_ = (next & mask_) != 0 ? frame + stride_ : words_;
        end_.store(next, std::memory_order_release);
        fence(std::memory_order_release);
    }
    /// Notes that the counters of the last cycle have their values, see ifSettled().
    void settle() noexcept RTCF_NONBLOCKING {
        settled_.store(end_.load(std::memory_order_relaxed), std::memory_order_release);
    }
    /// Times of the last frame, which must not be overwritten.
    CycleTicks lastTicks() const noexcept RTCF_NONBLOCKING;
    /// Ends of the components' update() in the last frame.
    const Word* lastEnded() const noexcept RTCF_NONBLOCKING {
        return at(end_.load(std::memory_order_relaxed) - 1) + kHeadWords;
    }
    /// @}

    /// @name Any thread
    /// @{
    const std::vector<Source>& sources() const noexcept { return copy_.sources(); }
    /// Offset of a source's value among a frame's values, bytes.
    std::size_t offset(std::size_t source) const noexcept { return copy_.offset(source); }
    /// Number of components that note their end.
    std::size_t steps() const noexcept { return steps_; }
    const CycleCounter& counter() const noexcept { return counter_; }
    std::size_t capacity() const noexcept { return mask_ + 1; }
    /// Number of the first frame after the last setBase(). Graph thread, while the loop does no
    /// work for it.
    std::uint64_t base() const noexcept { return base_end_; }
    /// Size of a frame, words.
    std::size_t wordsOfFrame() const noexcept { return stride_; }
    /// Size of a frame's values, its last words.
    std::size_t wordsOfValues() const noexcept { return copy_.words(); }
    /// The memory of the ring; null = the process's own memory.
    const std::shared_ptr<FrameBlock>& block() const noexcept { return block_; }
    /// Capacity of a ring of these sources, frames.
    static std::size_t capacityFor(const std::vector<Source>& sources, std::size_t steps,
                                   std::size_t frames);
    /// Number of the next frame; all smaller numbers have been committed.
    std::uint64_t end() const noexcept { return end_.load(std::memory_order_acquire); }
    /// Copies a committed frame.
    /// @return false if it has been overwritten
    bool read(std::uint64_t number, Frame& frame) const {
        return read(number, frame, steps_ + copy_.words());
    }
    /// Copies a committed frame without its values.
    /// @return false if it has been overwritten
    bool readTicks(std::uint64_t number, Frame& frame) const { return read(number, frame, steps_); }
    /// Result of readOutput().
    enum class Reading { Overwritten, Known, Copied };
    /// Copies an output from a committed frame, unless its stamp is `known` and the frame does not
    /// follow a restoration.
    /// @param source its number; an output with its header
    /// @param[out] to       SlotHeader and value, as in memory
    /// @param[out] stamp_ns the frame's CycleRecord::stamp_ns
    Reading readOutput(std::uint64_t number, std::size_t source, std::int64_t known, SlotHeader& to,
                       std::int64_t& stamp_ns) const;
    /// Calls `copy`, which copies counters that the loop changes from commit() to settle(): a
    /// sequence lock.
    /// @return false if the loop changed them meanwhile
    template <typename Copy>
    bool ifSettled(Copy&& copy) const {
        const std::uint64_t end = this->end();
        if (settled_.load(std::memory_order_acquire) != end) return false;
        copy();
        fence(std::memory_order_acquire);
        return end_.load(std::memory_order_relaxed) == end;
    }
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
    // Header of a frame, in words. kMark is 2 * number + 1 while the frame is being written, and 2
    // * number + 2 when it is complete.
    enum Head : std::size_t {
        kMark,
        kIteration,
        kStamp,
        kLatency,
        kKind,
        kBegin,
        kReady,
        kEnd,
        kHeadWords
    };

    // Flag in kKind, beside a FrameKind.
    static constexpr std::uint64_t kRestored = 4;

    template <typename T>
    static void put(Word& word, T value) noexcept RTCF_NONBLOCKING {
        word.store(static_cast<std::uint64_t>(value), std::memory_order_release);
    }
    static void fence(std::memory_order order) noexcept RTCF_NONBLOCKING {
#if defined(__SANITIZE_THREAD__)
        // ThreadSanitizer with gcc supports no other fence; x86 needs none
        std::atomic_signal_fence(order);
#else
        std::atomic_thread_fence(order);
#endif
    }
    bool read(std::uint64_t number, Frame& frame, std::size_t words) const;
    Word* at(std::uint64_t number) const noexcept { return words_ + (number & mask_) * stride_; }

    FrameCopy copy_;
    CycleCounter counter_;
    std::size_t steps_;
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
    std::atomic<std::uint64_t> settled_{0};  // end_ at the last settle()
    std::atomic<std::uint64_t> taken_{UINT64_MAX};
};

}  // namespace rtcf::executor
