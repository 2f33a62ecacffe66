/// @file
/// One cycle: everything between two waits, and the last cycle, in which components run safe()
/// instead of update(). Owned by the loop. It runs in the cycle thread: the loop's thread, or the
/// graph thread while the loop has none (steps, changes of a stopped loop). loop.hpp paces it.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "exchange/attention.hpp"
#include "faults/flight_recorder.hpp"
#include "frames/frame_ring.hpp"
#include "loop/adoption.hpp"
#include "loop/boundary.hpp"
#include "loop/faults.hpp"
#include "loop/schedule.hpp"
#include "realtime/cycle_counter.hpp"
#include "statistics/counter.hpp"
#include "statistics/histogram.hpp"

namespace rtcf::executor {

/// Statistics of the loop. Written by the cycle thread only. CycleStatistics has the durations.
struct LoopStatistics {
    Histogram adoption;  ///< ticks; time of adopting a change
    /// Ns from the requested end of the sleep (`spin` before the deadline) to the wake-up.
    Histogram wake_up;
    std::atomic<std::uint64_t> iteration{0};  ///< cycles completed since the loop started
    // These change between the end of a cycle and Cycle::settle().
    EventCounter overruns;
    EventCounter missed;
    // Causes of overruns other than components.
    EventCounter late_wake_ups;      ///< the cycle began late, but took less than a period
    EventCounter exchange_overruns;  ///< changes, or values from and to outside, took too long
    EventCounter frame_overruns;     ///< copying values into a frame took too long
    EventCounter catching_up;        ///< late because of the previous overrun, with CatchUp
};

/// What begins the cycles, and measures their time.
enum class Pace {
    RealTime,  ///< loop time is CLOCK_MONOTONIC
    Clock,     ///< a simulated clock; loop time is a count of periods from 0
    Steps,     ///< an operator; the same
};

class Cycle {
   public:
    /// @param recorder notes the running component; outlives the cycle
    explicit Cycle(FlightRecorder& recorder);
    Cycle(const Cycle&) = delete;
    Cycle& operator=(const Cycle&) = delete;

    /// @name Graph thread
    /// @{
    /// Sets the clock before the start hooks, so that their values belong to the start, and
    /// empties the queues of components. While no cycle runs. If CLOCK_MONOTONIC is not the loop
    /// time, or was not before, all values keep the ages of the last cycle.
    void announce(Pace pace);
    /// Resets clock and counters, so that the next cycle is number 0. Unless it is a step, takes
    /// the values from outside that arrived before it, as old ones. After announce() and the start
    /// hooks.
    void begin(std::int64_t period_ns, std::uint64_t warmup_cycles, Pace pace);
    /// Undoes begin() if no thread can run the cycles.
    void abandon() noexcept { active_ = false; }
    Boundary& boundary() noexcept { return boundary_; }
    const std::shared_ptr<Attention>& attention() const noexcept { return shared_attention_; }
    /// The fault that ended the loop; after the last cycle.
    const LoopFault& fault() const noexcept { return fault_; }
    /// @}

    /// @name Cycle thread; real-time safe if the components are
    /// @{
    const Schedule& schedule() const noexcept { return *schedule_; }
    bool faulted() const noexcept { return fault_.kind != LoopFault::Kind::None; }
    /// Performs pending boundary work, between cycles.
    /// @param time_ns loop time of the next cycle, and of hooks at the boundary
    void atBoundary(std::int64_t time_ns) noexcept {
        if (!boundary_.waiting()) return;
        boundary_time_ns_ = time_ns;
        boundary_.perform(*this);
    }
    /// Applies a change.
    void apply(Adoption& adoption) noexcept;
    /// Copies all values that the next cycle depends on.
    void capture(Capture& capture) noexcept;
    /// Runs one cycle.
    /// @param time_ns loop time
    /// @param latency_ns latency of the wake-up
    /// @return false if a fault ended the loop before any component ran
    bool run(std::int64_t time_ns, std::int64_t latency_ns) noexcept RTCF_NONBLOCKING;
    /// Runs the last cycle: safe() instead of update(). Once until the next begin().
    void makeSafe(std::int64_t time_ns) noexcept;
    /// Takes the newest values from outside.
    void feed() noexcept RTCF_NONBLOCKING;
    /// Sets the loop time before the first cycle, later than that of begin(); the ages of a
    /// snapshot's values are relative to it.
    void setTime(std::int64_t time_ns) noexcept RTCF_NONBLOCKING { clock_.time_ns = time_ns; }
    /// Sets elapsed() of the next cycles, in whole periods.
    void setElapsed(std::int64_t elapsed_ns) noexcept RTCF_NONBLOCKING {
        clock_.elapsed_ns = elapsed_ns;
    }
    /// Finds the component (or other work) that was running when the last cycle should have ended,
    /// and counts the overrun there.
    void blame(std::int64_t limit_ticks) noexcept RTCF_NONBLOCKING;
    void endLoop(LoopFault::Kind kind, const Component* component, const char* text) noexcept;
    /// Ends the counting for the last cycle.
    void settle() noexcept RTCF_NONBLOCKING { frames_->settle(); }
    LoopStatistics& statistics() noexcept { return statistics_; }
    /// @}

    /// @name Any thread
    /// @{
    const LoopStatistics& statistics() const noexcept { return statistics_; }
    const LoopClock& clock() const noexcept { return clock_; }
    void setStampOffset(std::int64_t offset_ns) noexcept {
        stamp_offset_ns_.store(offset_ns, std::memory_order_relaxed);
    }
    const CycleCounter& counter() const noexcept { return counter_; }
    /// @}

   private:
    Cycle(FlightRecorder& recorder, std::shared_ptr<Attention> attention);
    void setTimes(std::int64_t time_ns) noexcept RTCF_NONBLOCKING {
        clock_.time_ns = time_ns;
        clock_.stamp_ns = time_ns + stamp_offset_ns_.load(std::memory_order_relaxed);
    }
    void setClock(Pace pace);
    void moveTime(std::int64_t by_ns);
    void takeOld();
    void changeComponents(Adoption& adoption) noexcept;
    static void publish(Component& successor) noexcept;
    bool runSpecial(std::int64_t begin_ticks, std::int64_t time_ns,
                    std::int64_t latency_ns) noexcept;
    bool exchange(std::int64_t time_ns) noexcept;
    bool updateSelective(unsigned work, FrameRing::Word* ended) noexcept;
    void finish() noexcept RTCF_NONBLOCKING;
    template <bool Plain>
    bool update(const Step* next, const Step* end, FrameRing::Word* ended) noexcept;
    bool updateSelected(const Step* next, const Step* end, FrameRing::Word* ended) noexcept;
    void leaveOut(const Step* next, FrameRing::Word* ended) noexcept RTCF_NONBLOCKING;
    bool due(const Step& step) const noexcept RTCF_NONBLOCKING;
    void connectWaiting(const Step& step) noexcept RTCF_NONBLOCKING;
    void dropConnected() noexcept;
    // Copies a value for late readers, which may allocate.
    // @return false if that fails: the loop ends
    bool copy(const Latch& latch) noexcept;
    bool copyLatches() noexcept;
    void putBack(const Step& step) noexcept;
    /// Effect of a non-finite value on an output declared Finite(OnNonFinite::Stop): end the loop,
    /// or go on.
    enum class OnBadOutput { End, GoOn };
    void commit(Component& component, ComponentStatistics& statistics, OnBadOutput may);
    bool threw(const Step& step, const char* text) noexcept;
    void makeSafe(Component& component, ComponentStatistics& statistics, OnBadOutput may) noexcept;
    void noteWork() noexcept RTCF_NONBLOCKING;
    bool restore(Restoration& restoration) noexcept;

    // Members that every cycle touches, in two cache lines: after a sleep, cache misses cost more
    // than computation. Owned by the cycle thread.
    alignas(64) const Schedule* schedule_;
    FrameRing* frames_;  // filled by the cycles; has a word per step of the schedule
    Attention& attention_;
    const FlightRecorder::RealtimeNotes notes_;
    LoopClock clock_;
    // Shared.
    std::atomic<std::int64_t> stamp_offset_ns_{0};  // CLOCK_REALTIME minus CLOCK_MONOTONIC
    const std::shared_ptr<Attention> shared_attention_;
    Boundary boundary_;

    CycleCounter counter_;
    // Owned by the cycle thread, too.
    std::uint64_t warmup_cycles_ = 0;
    bool active_ = false;                // from begin() to the last cycle
    bool counted_ = false;               // the present cycle's device statistics count
    bool restored_ = false;              // values were restored since the last cycle
    bool monotonic_ = false;             // loop time is CLOCK_MONOTONIC of this boot
    std::int64_t boundary_time_ns_ = 0;  // loop time of the cycle after the present boundary
    std::int64_t total_elapsed_ns_ = 0;  // sum of elapsed_ns of all cycles
    std::vector<Waiting> waiting_;       // inputs that wait for a new writer, in schedule order
    std::size_t next_waiting_ = 0;       // the first one whose component has not run in this cycle
    std::int64_t given_ticks_ = 0;  // when values were last given to queues and serialized taps
    LoopFault fault_;
    LoopStatistics statistics_;
    DeviceStatistics uncounted_;  // device statistics of cycles that are not counted
    const Schedule empty_{};
    FrameRing no_frames_;  // of the empty schedule
};

}  // namespace rtcf::executor
