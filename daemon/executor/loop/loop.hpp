/// @file
/// The loop: one real-time thread that executes a schedule at a fixed
/// frequency. The graph thread starts it, hands it changes and joins it; any
/// thread may ask it to end and read its counters.
#pragma once

#include <pthread.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "faults/flight_recorder.hpp"
#include "loop/cycle_counter.hpp"
#include "loop/probe.hpp"
#include "loop/realtime.hpp"
#include "loop/schedule.hpp"
#include "spsc_ring.hpp"
#include "statistics/histogram.hpp"

namespace rtcf::executor {

class Log;
class SimulatedClock;

/// What to do after a cycle that ended when the next should have begun.
enum class OverrunPolicy { Skip, CatchUp, Relative };

struct LoopSettings {
    std::int64_t period_ns = 1'000'000;
    std::int64_t spin_ns = 0;  ///< busy wait before each deadline
    OverrunPolicy overrun = OverrunPolicy::Skip;
    std::uint32_t max_overruns = 0;    ///< leaky bucket; 0 = never stop for overruns
    std::uint64_t warmup_cycles = 10;  ///< first cycles, kept out of the figures
    RealtimeSettings realtime;
    /// Followed instead of real time, in a thread that is not real-time; null = real time.
    std::shared_ptr<SimulatedClock> clock;
};

/// One executed cycle.
struct CycleRecord {
    std::uint64_t iteration;
    std::int64_t stamp_ns;     ///< CLOCK_REALTIME of the deadline, or the simulated clock's time
    std::int64_t latency_ns;   ///< wake-up after the deadline; may be negative
    std::int64_t duration_ns;  ///< calculation
};

/// Why a loop ended by itself.
struct LoopFault {
    enum class Kind { None, Exception, NotFinite, Overruns };
    Kind kind = Kind::None;
    const Component* component =
        nullptr;  ///< the culprit, if it is one component; for comparison only
    std::array<char, 240> component_name{};  ///< its full name, as it may be gone when this is read
    std::uint64_t iteration = 0;
    std::array<char, 240> text{};  ///< what the exception said
};

/// A component that failed while the loop goes on.
struct ComponentFault {
    LoopFault::Kind kind = LoopFault::Kind::None;
    const Component* component = nullptr;
    std::uint64_t iteration = 0;
    std::array<char, 160> text{};
};

/// What the loop counts. Written by the real-time thread alone.
struct LoopFigures {
    Histogram duration;  ///< ticks
    Histogram latency;   ///< ns
    Histogram adoption;  ///< ticks; what a change took of the cycle that adopted it
    Histogram wake_up;   ///< ns after the end of the sleep, which is `spin` before the deadline
    std::atomic<std::uint64_t> iteration{0};  ///< cycles completed since the loop started
    std::atomic<std::uint64_t> overruns{0};
    std::atomic<std::uint64_t> missed{0};
};

class Loop {
   public:
    /// @param log the thread marks itself there; outlives the loop
    /// @param recorder what runs is noted there; outlives the loop
    Loop(Log& log, FlightRecorder& recorder);
    /// Ends the loop in order.
    ~Loop();
    Loop(const Loop&) = delete;
    Loop& operator=(const Loop&) = delete;

    /// @name By the graph thread
    /// @{
    /// Begins to execute the adopted schedule. @return what is missing for real time
    /// @throws Refusal if no thread can be made
    RealtimeProblems start(const LoopSettings& settings);
    /// Waits for the end of a loop that was asked to end or ended by itself, at most `timeout_ns`.
    /// @return false if it goes on
    bool join(std::int64_t timeout_ns);
    /// Executes cycles back to back on a simulated clock that begins at 0 with beginStepping();
    /// while the loop does not run. The same graph and inputs give the same values, bit by bit.
    /// @return cycles done; fewer if a component failed, or after requestStop()
    std::uint64_t step(std::uint64_t cycles) noexcept;
    /// Sets counters and clock as start() does, for step(). @param stamp_ns of the first cycle
    void beginStepping(const LoopSettings& settings, std::int64_t stamp_ns = 0);
    /// Calls safe() of all components, as at the end of a running loop.
    void endStepping() noexcept { makeSafe(); }
    /// Makes a change at the next boundary, or at once if the loop does not run.
    /// @return false if the loop reaches no boundary within `timeout_ns`; nothing has changed then
    bool adopt(Adoption& adoption, std::int64_t timeout_ns);
    /// Takes over values from outside while the loop does not run.
    void adoptInjections();
    /// Copies port values at the next boundary. @return false if the loop reaches none in time
    bool probe(Probe& probe, std::int64_t timeout_ns);
    /// Follows the wall clock for stamp(); to be called now and then.
    void refreshWallClock() noexcept;
    void setSpin(std::int64_t spin_ns) noexcept {
        spin_ns_.store(spin_ns, std::memory_order_relaxed);
    }
    /// New settings for a running loop (CPU, priority, spin, overrun policy); the period goes by
    /// adopt().
    RealtimeProblems retune(const LoopSettings& settings);
    /// After join().
    const LoopFault& fault() const noexcept { return fault_; }
    /// Takes the oldest report of a component that failed without ending the loop. @return false if
    /// there is none
    bool popFault(ComponentFault& fault);
    /// @}

    /// Takes the oldest cycle record. By one thread, whichever. @return false if there is none
    bool popRecord(CycleRecord& record);

    /// @name By any thread
    /// @{
    void requestStop() noexcept { stop_requested_.store(true, std::memory_order_release); }
    bool stopRequested() const noexcept { return stop_requested_.load(std::memory_order_acquire); }
    /// A thread executes cycles.
    bool running() const noexcept { return running_.load(std::memory_order_acquire); }
    /// The thread has been started and not been joined yet.
    bool joinable() const noexcept { return joinable_.load(std::memory_order_acquire); }
    /// A component is running just now.
    bool inCycle() const noexcept { return recorder_.runningSlot() != 0; }
    int threadId() const noexcept { return thread_id_.load(std::memory_order_relaxed); }
    const LoopFigures& figures() const noexcept { return figures_; }
    const CycleCounter& counter() const noexcept { return counter_; }
    /// Cycle records lost as nobody took them.
    std::uint64_t recordsDropped() const noexcept { return records_.dropped(); }
    /// @}

    /// The clock that components of this loop see.
    const LoopClock& clock() const noexcept { return clock_; }

   private:
    void reset(const LoopSettings& settings);
    static void* threadMain(void* self);
    void run() noexcept;
    void followRealTime() noexcept;
    void followClock() noexcept;
    void cycle(std::int64_t deadline_ns, std::int64_t wake_ns) noexcept RTCF_NONBLOCKING;
    template <bool Plain>
    bool update(const Schedule& schedule, FlightRecorder::RealtimeNotes notes,
                std::int64_t begin_ticks) noexcept;
    bool updateSelected(const Schedule& schedule, std::int64_t begin_ticks) noexcept;
    bool requested() const noexcept RTCF_NONBLOCKING;
    bool due(const Step& step) const noexcept RTCF_NONBLOCKING;
    void commitFinite(const Step& step) noexcept RTCF_NONBLOCKING;
    void componentFailed(LoopFault::Kind kind, const Step& step, const char* text) noexcept;
    void reportFault(LoopFault::Kind kind, const Component* component, const char* text) noexcept;
    void noteFault(LoopFault::Kind kind, const Component* component, const char* text) noexcept;
    void takeAdoption() noexcept RTCF_NONBLOCKING;
    void takeProbe() noexcept RTCF_NONBLOCKING;
    void feed() noexcept RTCF_NONBLOCKING;
    void noteSchedule() noexcept RTCF_NONBLOCKING;
    void setElapsed(std::int64_t elapsed_ns) noexcept RTCF_NONBLOCKING;
    void blameOverrun(std::int64_t begin_ticks, std::int64_t limit_ticks) noexcept RTCF_NONBLOCKING;
    std::int64_t nextDeadline(std::int64_t deadline_ns, std::int64_t end_ns) noexcept
        RTCF_NONBLOCKING;
    std::int64_t waitFor(std::int64_t deadline_ns) noexcept;
    std::int64_t waitForSource(Source& source) noexcept;
    void makeSafe() noexcept;

    // What every cycle touches, in two cache lines: after a sleep, memory costs more than work.
    // Owned by whoever runs cycles: the thread, or the graph thread while there is none.
    alignas(64) const Schedule* schedule_;
    const FlightRecorder::RealtimeNotes notes_;
    LoopClock clock_;
    std::uint64_t plain_from_ = UINT64_MAX;  // first iteration in which all is plain, see update()
    std::uint64_t warmup_cycles_ = 0;
    bool exchanges_ = false;  // the schedule has feeds, latches or taps
    // Shared.
    std::atomic<std::int64_t> stamp_offset_ns_{0};  // CLOCK_REALTIME minus CLOCK_MONOTONIC
    std::atomic<Probe*> probe_{nullptr};
    std::atomic<Adoption*> pending_{nullptr};
    std::atomic<bool> stop_requested_{false};

    Log& log_;
    FlightRecorder& recorder_;
    CycleCounter counter_;
    pthread_t thread_{};
    std::unique_ptr<IdleStateGuard> idle_guard_;
    std::shared_ptr<SimulatedClock> simulation_;  // that the thread follows; null = real time

    // As above: of whoever runs cycles.
    std::int64_t elapsed_ns_ = 0;        // whole periods since the last cycle
    std::int64_t total_elapsed_ns_ = 0;  // loop time in whole periods
    bool any_disabled_ = false;
    std::uint32_t bucket_ = 0;
    std::uint64_t cycles_on_time_ = 0;
    LoopFault fault_;

    // Shared.
    Probe claimed_probe_;  // stands in probe_ while a probe is taken
    Adoption claimed_;     // stands in pending_ while an adoption is applied
    std::atomic<bool> running_{false};
    std::atomic<bool> joinable_{false};
    std::atomic<int> thread_id_{0};
    std::atomic<std::int64_t> spin_ns_{0};
    std::atomic<OverrunPolicy> overrun_policy_{OverrunPolicy::Skip};
    std::atomic<std::uint32_t> max_overruns_{0};
    std::size_t stack_bytes_ = 0;
    LoopFigures figures_;
    SpscRing<CycleRecord, 16384> records_;
    SpscRing<ComponentFault, 64> faults_;
    const Schedule empty_{};
};

}  // namespace rtcf::executor
