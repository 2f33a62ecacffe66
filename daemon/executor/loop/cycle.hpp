/// @file
/// One cycle: all that happens between two waits, and the last one, in which
/// components make safe instead of updating. The loop owns it; its thread
/// runs it, or the graph thread while there is none. Who paces it is another
/// matter, see loop.hpp.
#pragma once

#include <atomic>
#include <cstdint>

#include "common/spsc_ring.hpp"
#include "faults/flight_recorder.hpp"
#include "frames/cycle_record.hpp"
#include "frames/frame_ring.hpp"
#include "loop/boundary.hpp"
#include "loop/faults.hpp"
#include "loop/schedule.hpp"
#include "realtime/cycle_counter.hpp"
#include "statistics/counting.hpp"
#include "statistics/histogram.hpp"

namespace rtcf::executor {

/// What the loop counts. Written by the real-time thread alone.
struct LoopFigures {
    Histogram duration;  ///< ticks
    Histogram latency;   ///< ns
    Histogram adoption;  ///< ticks; what a change took of the cycle that adopted it
    Histogram wake_up;   ///< ns after the end of the sleep, which is `spin` before the deadline
    Counting counting;   ///< what belongs together of these, and of components'
    std::atomic<std::uint64_t> iteration{0};  ///< cycles completed since the loop started
    Counter faults;                           ///< of components, while the loop went on
    std::atomic<std::uint64_t> overruns{0};
    std::atomic<std::uint64_t> missed{0};
    // Causes of overruns that no component is.
    Counter late_wake_ups;      ///< the cycle took less than a period, but began late
    Counter exchange_overruns;  ///< changes, values from outside and to it took too long
    Counter frame_overruns;     ///< copying values into a frame took too long
    Counter catching_up;        ///< late by the overrun before, with OverrunPolicy::CatchUp
};

/// Adds to a number that only this thread writes. Real-time safe.
inline void bump(std::atomic<std::uint64_t>& number, std::uint64_t by = 1) noexcept
    RTCF_NONBLOCKING {
    number.store(number.load(std::memory_order_relaxed) + by, std::memory_order_relaxed);
}

class Cycle {
   public:
    /// @param recorder what runs is noted there; outlives the cycle
    explicit Cycle(FlightRecorder& recorder);
    Cycle(const Cycle&) = delete;
    Cycle& operator=(const Cycle&) = delete;

    /// @name Graph thread
    /// @{
    /// Sets clock and counters for cycles from 0 on; while none runs.
    void begin(std::int64_t period_ns, std::uint64_t warmup_cycles);
    /// Of a loop that has begun and has no thread to run it.
    void abandon() noexcept { active_ = false; }
    Boundary& boundary() noexcept { return boundary_; }
    /// After the last cycle.
    const LoopFault& fault() const noexcept { return fault_; }
    /// @}

    /// @name Whoever runs cycles; real-time safe as far as the components are
    /// @{
    const Schedule& schedule() const noexcept { return *schedule_; }
    bool faulted() const noexcept { return fault_.kind != LoopFault::Kind::None; }
    /// Performs pending boundary work, between cycles. @param time_ns of the cycle that it begins,
    /// and of hooks that run at the boundary
    void atBoundary(std::int64_t time_ns) noexcept {
        if (!boundary_.waiting()) return;
        boundary_time_ns_ = time_ns;
        boundary_.perform(*this);
    }
    /// Makes a change.
    void apply(Adoption& adoption) noexcept;
    /// Copies what the next cycle depends on.
    void capture(Capture& capture) noexcept;
    /// One cycle, in a turn of the figures. @param time_ns of the loop @param latency_ns of its
    /// wake-up @return false if the loop's fault came before any component ran
    bool run(std::int64_t time_ns, std::int64_t latency_ns) noexcept RTCF_NONBLOCKING;
    /// The last cycle: safe() in place of update(). Once until the next begin().
    void makeSafe(std::int64_t time_ns) noexcept;
    /// Takes the newest values from outside.
    void feed() noexcept RTCF_NONBLOCKING;
    /// The time before the first cycle, from which a snapshot's values count back.
    void setTime(std::int64_t time_ns) noexcept RTCF_NONBLOCKING { clock_.time_ns = time_ns; }
    /// What elapsed() says to components from the next cycle on, whole periods.
    void setElapsed(std::int64_t elapsed_ns) noexcept RTCF_NONBLOCKING {
        clock_.elapsed_ns = elapsed_ns;
    }
    /// Finds what was running when the cycle that began at `begin_ticks` should have ended, and
    /// counts the overrun there.
    void blame(std::int64_t begin_ticks, std::int64_t limit_ticks) noexcept RTCF_NONBLOCKING;
    void endLoop(LoopFault::Kind kind, const Component* component, const char* text) noexcept;
    LoopFigures& figures() noexcept { return figures_; }
    /// @}

    /// @name Any thread
    /// @{
    const LoopFigures& figures() const noexcept { return figures_; }
    const LoopClock& clock() const noexcept { return clock_; }
    void setStampOffset(std::int64_t offset_ns) noexcept {
        stamp_offset_ns_.store(offset_ns, std::memory_order_relaxed);
    }
    const CycleCounter& counter() const noexcept { return counter_; }
    SpscRing<CycleRecord, 16384>& records() noexcept { return records_; }
    const SpscRing<CycleRecord, 16384>& records() const noexcept { return records_; }
    /// @}

   private:
    void setTimes(std::int64_t time_ns) noexcept RTCF_NONBLOCKING {
        clock_.time_ns = time_ns;
        clock_.stamp_ns = time_ns + stamp_offset_ns_.load(std::memory_order_relaxed);
    }
    void changeComponents(Adoption& adoption) noexcept;
    std::int64_t exchange(std::int64_t begin_ticks, std::int64_t time_ns) noexcept;
    template <bool Plain>
    std::int64_t update(const Step* next, const Step* end, std::int64_t before) noexcept;
    std::int64_t updateSelected(const Step* next, const Step* end, std::int64_t before) noexcept;
    bool due(const Step& step) const noexcept RTCF_NONBLOCKING;
    // Copies a value for others, which may take memory. @return false if that fails: the loop ends
    bool copy(const Latch& latch) noexcept;
    bool copyLatches() noexcept;
    void putBack(Component& component) noexcept;
    void putBack(OutputBase& output) noexcept;
    /// What an output that is declared Finite(OnNonFinite::Stop) may do if it is not.
    enum class OnBadOutput { End, GoOn };
    void commit(Component& component, ComponentFigures& figures, OnBadOutput may);
    bool threw(const Step& step, const char* text) noexcept;
    void makeSafe(Component& component, ComponentFigures& figures, OnBadOutput may) noexcept;
    void noteSchedule() noexcept RTCF_NONBLOCKING;
    bool restore(Restoration& restoration) noexcept;

    // What every cycle touches, in two cache lines: after a sleep, memory costs more than work.
    // Owned by whoever runs cycles.
    alignas(64) const Schedule* schedule_;
    const FlightRecorder::RealtimeNotes notes_;
    LoopClock clock_;
    std::uint64_t warmup_cycles_ = 0;
    bool exchanges_ = false;       // the schedule has feeds, latches, queues or taps
    bool active_ = false;          // between begin() and the last cycle
    FrameRing* frames_ = nullptr;  // that the cycles fill
    bool counted_ = false;         // the present cycle's durations
    // Shared.
    std::atomic<std::int64_t> stamp_offset_ns_{0};  // CLOCK_REALTIME minus CLOCK_MONOTONIC
    Boundary boundary_;

    CycleCounter counter_;
    // As above: of whoever runs cycles.
    std::int64_t boundary_time_ns_ = 0;        // of the cycle that the present boundary begins
    std::int64_t total_elapsed_ns_ = 0;        // loop time in whole periods
    std::int64_t exchanged_ticks_ = 0;         // what the last exchange took,
    std::uint64_t exchanged_at_ = UINT64_MAX;  // and its iteration
    std::int64_t given_ticks_ = 0;             // when values for outside were last in their taps
    LoopFault fault_;
    LoopFigures figures_;
    DeviceFigures uncounted_;  // what components' devices cost in cycles that are not counted
    SpscRing<CycleRecord, 16384> records_;
    const Schedule empty_{};
};

}  // namespace rtcf::executor
