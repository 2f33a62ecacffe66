/// @file
/// The loop: one real-time thread that executes a schedule at a fixed frequency. The graph thread
/// starts it, hands it changes and joins it; any thread may stop it and read its counters.
/// It begins cycles by real time, by a device, by a simulated clock, or one after another as steps;
/// cycle.hpp contains the cycle.
#pragma once

#include <pthread.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "faults/flight_recorder.hpp"
#include "loop/adoption.hpp"
#include "loop/cycle.hpp"
#include "loop/overload.hpp"
#include "loop/probe.hpp"
#include "loop/schedule.hpp"
#include "realtime/cpu_claim.hpp"
#include "realtime/other_threads.hpp"
#include "realtime/realtime.hpp"
#include "realtime/thread_locals.hpp"

namespace rtcf::executor {

class Log;
class SimulatedClock;

/// Action after an overrun: a cycle that ended after the next one should have begun.
enum class OverrunPolicy { Skip, CatchUp, Relative };

struct LoopSettings {
    std::int64_t period_ns = 1'000'000;
    std::int64_t spin_ns = 0;  ///< busy wait before each deadline, ns
    OverrunPolicy overrun = OverrunPolicy::Skip;
    /// Size of the leaky bucket of overruns; 0 = never stop for overruns.
    std::uint32_t max_overruns = 0;
    std::uint64_t warmup_cycles = 10;  ///< first cycles, which statistics do not count
    RealtimeSettings realtime;
    /// Simulated clock, for a loop in a thread that is not real-time; null = real time.
    std::shared_ptr<SimulatedClock> clock;
};

class Loop {
   public:
    /// @param log notified of the real-time thread; outlives the loop
    /// @param recorder notes the running component; outlives the loop
    /// @param cpu_claims folder of CPU claims, shared by loops that must not use the same CPU, see
    /// CpuClaim
    Loop(Log& log, FlightRecorder& recorder, std::string cpu_claims);
    /// Ends the loop in order.
    ~Loop();
    Loop(const Loop&) = delete;
    Loop& operator=(const Loop&) = delete;

    /// @name Graph thread
    /// @{
    /// Sets the clock before the start hooks, see Cycle::announce(). While the loop does not run.
    void announce(Pace pace);
    /// Starts the thread, which executes the adopted schedule.
    /// @param stops_known value of stops() when this start was requested
    /// @return missing prerequisites of real time
    /// @throws Error if the thread cannot be created, or if a stop was requested since; the loop
    /// does not run then
    RealtimeProblems start(const LoopSettings& settings, std::uint64_t stops_known);
    /// Waits for the end of a loop that was stopped or ended by itself.
    /// @return false if it still runs after `timeout_ns`
    bool join(std::int64_t timeout_ns);
    /// Executes cycles back to back on a simulated clock; the time of the first one after
    /// beginStepping() is a period.
    /// While the loop does not run. The same graph and inputs give the same values, bit by bit.
    /// @param given_up checked before each cycle; null = never given up
    /// @return cycles done; fewer than `cycles` if a component failed, if it was given up, or after
    /// requestStop()
    std::uint64_t step(std::uint64_t cycles, const std::atomic<bool>* given_up = nullptr) noexcept;
    /// Resets counters and clock as start() does, for step().
    /// @param stamp_ns ROS time of the first cycle
    /// @throws Error if a stop was requested since, as start() does
    void beginStepping(const LoopSettings& settings, std::uint64_t stops_known,
                       std::int64_t stamp_ns = 0);
    /// Runs the last cycle with safe() of all components, as at the end of a running loop.
    void endStepping() noexcept;
    /// Applies a change at the next boundary, or at once if the loop does not run.
    /// @return false if the loop reaches no boundary within `timeout_ns`; nothing has changed then
    bool adopt(Adoption& adoption, std::int64_t timeout_ns);
    /// Copies all values that the next cycle depends on, at the next boundary, or at once if the
    /// loop does not run.
    /// @return false if the loop reaches no boundary within `timeout_ns`
    bool capture(Capture& capture, std::int64_t timeout_ns);
    /// Adopts values from outside while the loop does not run.
    void adoptInjections();
    /// Copies port values at the next boundaries, see Probe.
    /// @return false if the loop reaches no boundary in time
    bool probe(Probe& probe, std::int64_t timeout_ns);
    /// Adjusts stamp() to the wall clock. Called periodically.
    void refreshWallClock() noexcept;
    void setSpin(std::int64_t spin_ns) noexcept {
        spin_ns_.store(spin_ns, std::memory_order_relaxed);
    }
    /// Sets LoopSettings::max_overruns.
    void setMostOverruns(std::uint32_t most) noexcept {
        max_overruns_.store(most, std::memory_order_relaxed);
    }
    /// Changes the settings of a running loop (CPU, priority, spin, overrun policy); adopt()
    /// changes the period.
    /// @return missing prerequisites of real time, as from start()
    RealtimeProblems retune(const LoopSettings& settings);
    /// A library file whose thread_local variables have no memory in the running real-time thread:
    /// `library` itself, or one that it links against. Empty = none.
    /// @param library handle of dlopen()
    std::string lackingThreadLocals(void* library) const {
        return inRealTime() && thread_locals_ ? thread_locals_->lacking(library) : std::string();
    }
    /// The fault that ended the loop; after join().
    const LoopFault& fault() const noexcept { return cycle_.fault(); }
    /// @}

    /// @name Any thread
    /// @{
    /// Stops the loop at the next boundary. The stop is final: a start() that was requested before
    /// it fails.
    void requestStop() noexcept { stops_.fetch_add(1); }
    /// Number of stops requested so far.
    std::uint64_t stops() const noexcept { return stops_.load(); }
    /// True if a stop was requested since the start. Graph thread and cycle thread.
    bool stopRequested() const noexcept {
        return stops_.load(std::memory_order_acquire) != stops_known_;
    }
    /// True if real time or a device paces the loop, and not a simulated clock. Graph thread.
    bool inRealTime() const noexcept { return joinable() && simulation_ == nullptr; }
    /// True while the thread executes cycles.
    bool running() const noexcept { return running_.load(std::memory_order_acquire); }
    /// True from start() to join().
    bool joinable() const noexcept { return joinable_.load(std::memory_order_acquire); }
    /// True while a component's hook runs in the loop's thread.
    bool inComponent() const noexcept { return recorder_.runningSlot() != 0; }
    /// Grows with each cycle and with each return of a Source's wait().
    std::uint64_t progress() const noexcept {
        return statistics().iteration.load(std::memory_order_relaxed) + waits_.value();
    }
    /// Number of rests because of an overload.
    std::uint64_t rests() const noexcept { return rests_.value(); }
    /// CPU that the thread is pinned to; -1 = none.
    int cpu() const noexcept { return cpu_.load(std::memory_order_relaxed); }
    int threadId() const noexcept { return thread_id_.load(std::memory_order_relaxed); }
    const LoopStatistics& statistics() const noexcept { return cycle_.statistics(); }
    LoopStatistics& statistics() noexcept { return cycle_.statistics(); }
    const CycleCounter& counter() const noexcept { return cycle_.counter(); }
    const Cycle& cycle() const noexcept { return cycle_; }
    /// @}

    /// The clock that components of this loop see.
    const LoopClock& clock() const noexcept { return cycle_.clock(); }

   private:
    /// Result of a wait.
    struct WakeUp {
        bool cycle = false;  // a cycle begins
        std::int64_t deadline_ns = 0;
        std::int64_t wake_ns = 0;
        std::int64_t missed = 0;  ///< beats of a device missed before this one
    };

    void reset(const LoopSettings& settings, std::uint64_t stops_known, Pace pace);
    RealtimeSettings placed(RealtimeSettings settings, RealtimeProblems& problems);
    void leaveCpu();
    bool perform(BoundaryWork& work, std::int64_t timeout_ns);
    static void* threadMain(void* self);
    void run() noexcept;
    bool goesOn() const noexcept { return !stopRequested() && !cycle_.faulted(); }
    void followRealTime() noexcept;
    void followClock() noexcept;
    WakeUp waitForClock(std::int64_t deadline_ns) noexcept;
    WakeUp waitForSource(Source& device) noexcept;
    Source* source() const noexcept;
    std::int64_t nextStep() const noexcept;
    std::int64_t afterLastCycle(std::int64_t time_ns) const noexcept;
    std::int64_t endOfCycle(const WakeUp& wake_up, std::int64_t begin_ticks,
                            std::int64_t limit_ns) const noexcept RTCF_NONBLOCKING;
    void noteMissed(std::int64_t periods) noexcept RTCF_NONBLOCKING;
    void countOverrun(const WakeUp& wake_up, std::int64_t begin_ticks, std::int64_t end_ns,
                      bool behind) noexcept RTCF_NONBLOCKING;
    void noteOverrun(const WakeUp& wake_up, std::int64_t begin_ticks, std::int64_t end_ns,
                     bool behind) noexcept RTCF_NONBLOCKING;
    std::int64_t nextDeadline(std::int64_t deadline_ns, std::int64_t end_ns,
                              std::int64_t rest_ns) noexcept RTCF_NONBLOCKING;

    Cycle cycle_;
    Log& log_;
    FlightRecorder& recorder_;
    const std::string cpu_claims_;
    pthread_t thread_{};
    std::unique_ptr<IdleStateGuard> idle_guard_;
    std::unique_ptr<CpuClaim> cpu_claim_;  // while the loop runs in real time
    OtherThreads other_threads_;           // while the loop runs in real time
    std::atomic<int> cpu_{-1};
    std::shared_ptr<SimulatedClock> simulation_;  // clock that paces the thread; null = real time
    std::size_t stack_bytes_ = 0;
    std::optional<ThreadLocals> thread_locals_;  // of the thread, while there is one
    unsigned long long stepped_loads_ = 0;       // ThreadLocals::loads() at the last step

    // Owned by the cycle thread.
    std::uint64_t stops_known_ = 0;  // stops() when the present cycles were requested
    std::uint32_t bucket_ = 0;       // leaky bucket of overruns
    std::uint64_t cycles_on_time_ = 0;
    std::uint32_t caught_up_ = 0;  // cycles since the last one on time
    std::int64_t beat_ns_ = 0;     // time of the last beat of a Source; 0 = none yet
    Overload overload_;

    // Shared.
    std::atomic<std::uint64_t> stops_{0};
    Counter waits_;
    Counter rests_;
    std::atomic<bool> running_{false};
    std::atomic<bool> joinable_{false};
    std::atomic<int> thread_id_{0};
    std::atomic<std::int64_t> spin_ns_{0};
    std::atomic<OverrunPolicy> overrun_policy_{OverrunPolicy::Skip};
    std::atomic<std::uint32_t> max_overruns_{0};
};

}  // namespace rtcf::executor
