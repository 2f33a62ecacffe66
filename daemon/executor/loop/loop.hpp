/// @file
/// The loop: one real-time thread that executes a schedule at a fixed
/// frequency. The graph thread starts it, hands it changes and joins it; any
/// thread may ask it to end and read its counters. What a cycle is stands in
/// cycle.hpp; when one begins, by real time, a device, a simulated clock or as
/// a step, in pacing.cpp.
#pragma once

#include <pthread.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "faults/flight_recorder.hpp"
#include "loop/cycle.hpp"
#include "loop/probe.hpp"
#include "loop/schedule.hpp"
#include "realtime/cpu_claim.hpp"
#include "realtime/other_threads.hpp"
#include "realtime/realtime.hpp"
#include "realtime/thread_locals.hpp"

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

class Loop {
   public:
    /// @param log the thread marks itself there; outlives the loop
    /// @param recorder what runs is noted there; outlives the loop
    /// @param cpu_claims folder where loops that are to know of each other claim CPUs, see CpuClaim
    Loop(Log& log, FlightRecorder& recorder, std::string cpu_claims);
    /// Ends the loop in order.
    ~Loop();
    Loop(const Loop&) = delete;
    Loop& operator=(const Loop&) = delete;

    /// @name By the graph thread
    /// @{
    /// Begins to execute the adopted schedule. @param stops_known what stops() was when this was
    /// asked for @return what is missing for real time
    /// @throws Refusal if no thread can be made, or if a stop was requested since; nothing runs
    /// then
    RealtimeProblems start(const LoopSettings& settings, std::uint64_t stops_known);
    /// Waits for the end of a loop that was asked to end or ended by itself, at most `timeout_ns`.
    /// @return false if it goes on
    bool join(std::int64_t timeout_ns);
    /// Executes cycles back to back on a simulated clock that begins at 0 with beginStepping();
    /// while the loop does not run. The same graph and inputs give the same values, bit by bit.
    /// @param given_up looked at before each cycle; null = nobody gives up
    /// @return cycles done; fewer if a component failed, was given up, or after requestStop()
    std::uint64_t step(std::uint64_t cycles, const std::atomic<bool>* given_up = nullptr) noexcept;
    /// Sets counters and clock as start() does, for step(). @param stamp_ns of the first cycle
    /// @throws Refusal as start() does if a stop was requested since
    void beginStepping(const LoopSettings& settings, std::uint64_t stops_known,
                       std::int64_t stamp_ns = 0);
    /// The last cycle, in which components make safe, as at the end of a running loop.
    void endStepping() noexcept;
    /// Makes a change at the next boundary, or at once if the loop does not run.
    /// @return false if the loop reaches no boundary within `timeout_ns`; nothing has changed then
    bool adopt(Adoption& adoption, std::int64_t timeout_ns);
    /// Copies what the next cycle depends on, at the next boundary, or at once if the loop does not
    /// run. @return false if the loop reaches none within `timeout_ns`
    bool capture(Capture& capture, std::int64_t timeout_ns);
    /// Takes over values from outside while the loop does not run.
    void adoptInjections();
    /// Copies port values at the next boundaries, see Probe. @return false if the loop reaches none
    /// in time
    bool probe(Probe& probe, std::int64_t timeout_ns);
    /// Follows the wall clock for stamp(); to be called now and then.
    void refreshWallClock() noexcept;
    void setSpin(std::int64_t spin_ns) noexcept {
        spin_ns_.store(spin_ns, std::memory_order_relaxed);
    }
    /// Ends the loop after so many overruns, see LoopSettings, from here on.
    void setMostOverruns(std::uint32_t most) noexcept {
        max_overruns_.store(most, std::memory_order_relaxed);
    }
    /// New settings for a running loop (CPU, priority, spin, overrun policy); the period goes by
    /// adopt(). @return what its thread lacks for real time then, as start() returns it
    RealtimeProblems retune(const LoopSettings& settings);
    /// The file of a library that `library`, of dlopen(), is or links against, and of whose
    /// thread_local variables the thread that runs in real time has no memory; empty = none.
    std::string lackingThreadLocals(void* library) const {
        return inRealTime() && thread_locals_ ? thread_locals_->lacking(library) : std::string();
    }
    /// After join().
    const LoopFault& fault() const noexcept { return cycle_.fault(); }
    /// @}

    /// Takes the oldest cycle record. By one thread, whichever. @return false if there is none
    bool popRecord(CycleRecord& record);

    /// @name By any thread
    /// @{
    /// Ends the loop at the next boundary. It is final: what was asked for before, see start(),
    /// cannot begin cycles any more.
    void requestStop() noexcept { stops_.fetch_add(1); }
    /// How many stops have been requested.
    std::uint64_t stops() const noexcept { return stops_.load(); }
    /// Cycles that have begun are to end. Graph thread, and the loop's own.
    bool stopRequested() const noexcept {
        return stops_.load(std::memory_order_acquire) != stops_known_;
    }
    /// By real time or a device; not by a simulated clock. Graph thread.
    bool inRealTime() const noexcept { return joinable() && simulation_ == nullptr; }
    /// A thread executes cycles.
    bool running() const noexcept { return running_.load(std::memory_order_acquire); }
    /// The thread has been started and not been joined yet.
    bool joinable() const noexcept { return joinable_.load(std::memory_order_acquire); }
    /// A component's hook is running just now in the loop's thread.
    bool inComponent() const noexcept { return recorder_.runningSlot() != 0; }
    /// Grows whenever the loop gets on: by cycles, and by each return of a Source's wait().
    std::uint64_t progress() const noexcept {
        return figures().iteration.load(std::memory_order_relaxed) + waits_.value();
    }
    /// That it is pinned to; -1 = none.
    int cpu() const noexcept { return cpu_.load(std::memory_order_relaxed); }
    int threadId() const noexcept { return thread_id_.load(std::memory_order_relaxed); }
    const LoopFigures& figures() const noexcept { return cycle_.figures(); }
    /// Keeps cycles that begin from here on out of the figures, so that they can be read as of one
    /// instant, or goes on. One thread.
    void holdFigures(bool held) noexcept {
        held ? cycle_.figures().counting.hold() : cycle_.figures().counting.release();
    }
    const CycleCounter& counter() const noexcept { return cycle_.counter(); }
    /// Cycle records lost as nobody took them.
    std::uint64_t recordsDropped() const noexcept { return cycle_.records().dropped(); }
    /// @}

    /// The clock that components of this loop see.
    const LoopClock& clock() const noexcept { return cycle_.clock(); }

   private:
    /// What became of a wait.
    struct WakeUp {
        bool cycle = false;  // one is to begin,
        std::int64_t deadline_ns = 0;
        std::int64_t wake_ns = 0;
        std::int64_t missed = 0;  ///< beats of a device before it
    };

    void reset(const LoopSettings& settings, std::uint64_t stops_known);
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
    std::int64_t endOfCycle(const WakeUp& wake_up, std::int64_t begin_ticks,
                            std::int64_t limit_ns) const noexcept RTCF_NONBLOCKING;
    void noteMissed(std::int64_t periods) noexcept RTCF_NONBLOCKING;
    void countOverrun(const WakeUp& wake_up, std::int64_t begin_ticks, std::int64_t end_ns,
                      bool behind) noexcept RTCF_NONBLOCKING;
    void noteOverrun(const WakeUp& wake_up, std::int64_t begin_ticks, std::int64_t end_ns,
                     bool behind) noexcept RTCF_NONBLOCKING;
    std::int64_t nextDeadline(std::int64_t deadline_ns, std::int64_t end_ns) noexcept
        RTCF_NONBLOCKING;

    Cycle cycle_;
    Log& log_;
    FlightRecorder& recorder_;
    const std::string cpu_claims_;
    pthread_t thread_{};
    std::unique_ptr<IdleStateGuard> idle_guard_;
    std::unique_ptr<CpuClaim> cpu_claim_;  // while it runs in real time
    OtherThreads other_threads_;           // while it runs in real time
    std::atomic<int> cpu_{-1};
    std::shared_ptr<SimulatedClock> simulation_;  // that the thread follows; null = real time
    std::size_t stack_bytes_ = 0;
    std::optional<ThreadLocals> thread_locals_;  // that the thread has, as long as there is one
    unsigned long long stepped_loads_ = 0;       // whose thread_locals a step has

    // Of whoever runs cycles.
    std::uint64_t stops_known_ = 0;  // when the present cycles were asked for
    std::uint32_t bucket_ = 0;       // of overruns
    std::uint64_t cycles_on_time_ = 0;
    std::uint32_t caught_up_ = 0;  // cycles since the last one on time
    std::int64_t beat_ns_ = 0;     // when a Source was last ready; 0 = not yet

    // Shared.
    std::atomic<std::uint64_t> stops_{0};
    Counter waits_;
    std::atomic<bool> running_{false};
    std::atomic<bool> joinable_{false};
    std::atomic<int> thread_id_{0};
    std::atomic<std::int64_t> spin_ns_{0};
    std::atomic<OverrunPolicy> overrun_policy_{OverrunPolicy::Skip};
    std::atomic<std::uint32_t> max_overruns_{0};
};

}  // namespace rtcf::executor
