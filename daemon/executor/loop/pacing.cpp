// Pacing of the loop: begins cycles by real time, by a device, by a simulated clock, or one after
// another as steps.
#include <time.h>

#include <algorithm>
#include <cerrno>
#include <optional>
#include <utility>

#include "common/time_units.hpp"
#include "faults/crash_handler.hpp"
#include "logging/log.hpp"
#include "loop/loop.hpp"
#include "loop/simulated_clock.hpp"
#include "realtime/floating_point.hpp"

namespace rtcf::executor {

namespace {

// Cycles on time that remove one overrun from the bucket.
constexpr std::uint64_t kBucketLeak = 1000;
// Most cycles to catch up in a row; after a freeze of the machine there are many.
constexpr std::uint32_t kMostCaughtUp = 100;

}  // namespace

void Loop::beginStepping(const LoopSettings& settings, std::uint64_t stops_known,
                         std::int64_t stamp_ns) {
    reset(settings, stops_known);
    cycle_.setStampOffset(stamp_ns);
}

std::uint64_t Loop::step(std::uint64_t cycles, const std::atomic<bool>* given_up) noexcept {
    const auto wanted = [given_up] {
        return given_up == nullptr || !given_up->load(std::memory_order_relaxed);
    };
    std::uint64_t done = 0;
    if (const auto loads = ThreadLocals::loads(); loads != stepped_loads_) {
        ThreadLocals().touch();
        stepped_loads_ = loads;
    }
    const FloatingPointDefaults floating_point;
    // Logs and crashes of components are attributed to the real-time thread, as in any cycle.
    const CrashRole crash_role(ThreadRole::Realtime);
    Log::setRealtimeThread(true);
    for (; done < cycles && goesOn() && wanted(); ++done) {
        const Counting::Turn turn(cycle_.statistics().counting);
        if (!cycle_.run(nextStep(), 0)) break;
        // Also after a snapshot with another elapsed time, and after a change of the period.
        cycle_.setElapsed(cycle_.clock().period_ns);
    }
    Log::setRealtimeThread(false);
    return done;
}

void Loop::endStepping() noexcept {
    const FloatingPointDefaults floating_point;
    const CrashRole crash_role(ThreadRole::Realtime);
    cycle_.makeSafe(nextStep());
}

// Loop time of the next simulated cycle: begins at 0 and advances by a period each cycle.
std::int64_t Loop::nextStep() const noexcept {
    const LoopClock& clock = cycle_.clock();
    const std::int64_t period = clock.period_ns;
    return clock.iteration == 0 ? 0 : clock.time_ns + period;
}

// The component whose device paces the loop; null = none, the clock does.
Source* Loop::source() const noexcept {
    Source* const source = cycle_.schedule().source;
    return source != nullptr && !source->context().disabled ? source : nullptr;
}

void Loop::followRealTime() noexcept {
    const std::int64_t now = monotonicNow();
    cycle_.setTime(now);
    std::int64_t deadline = now + cycle_.clock().period_ns;
    std::int64_t end = 0;
    while (goesOn()) {
        Source* const device = source();
        const bool behind = device == nullptr && end > deadline;
        const WakeUp wake_up = device != nullptr ? waitForSource(*device) : waitForClock(deadline);
        if (!wake_up.cycle) {
            deadline = wake_up.wake_ns + cycle_.clock().period_ns;
            continue;
        }
        const Counting::Turn turn(cycle_.statistics().counting);
        noteMissed(wake_up.missed);
        const std::int64_t begin = readCycleCounter();
        const std::int64_t time = device != nullptr ? wake_up.wake_ns : wake_up.deadline_ns;
        if (!cycle_.run(time, wake_up.wake_ns - wake_up.deadline_ns)) break;
        // A device begins the next cycle itself; waitForSource() counts missed beats.
        const std::int64_t limit = time + cycle_.clock().period_ns;
        end = endOfCycle(wake_up, begin, limit);
        if (end >= limit) noteOverrun(wake_up, begin, end, behind);
        deadline = device != nullptr ? limit : nextDeadline(wake_up.deadline_ns, end);
    }
}

// End time of the cycle, ns. Reading the cycle counter takes one instruction, but during a suspend
// of the machine it may go on while CLOCK_MONOTONIC stops, or restart from 0. So if the counter
// says that the cycle is late, or ended before it began, CLOCK_MONOTONIC decides.
std::int64_t Loop::endOfCycle(const WakeUp& wake_up, std::int64_t begin_ticks,
                              std::int64_t limit_ns) const noexcept RTCF_NONBLOCKING {
    const std::int64_t ticks = readCycleCounter() - begin_ticks;
    const std::int64_t end = wake_up.wake_ns + cycle_.counter().toNs(ticks);
    return ticks >= 0 && end < limit_ns ? end : monotonicNow();
}

// Follows a simulated clock. time() of the components advances by a period each cycle, even if the
// simulated clock jumps; stamp() is the clock's time.
void Loop::followClock() noexcept {
    constexpr auto kPatience = std::chrono::milliseconds(10);
    while (goesOn()) {
        const std::optional<SimulatedCycle> due =
            simulation_->next(cycle_.clock().period_ns, kPatience);
        if (!due) {
            cycle_.atBoundary(nextStep());
            continue;
        }
        for (const Feed& feed : cycle_.schedule().feeds) {
            feed.injector->deliverUntil(due->arrived_ns, due->rate);
        }
        const std::int64_t now = nextStep();
        cycle_.setStampOffset(due->time_ns - now);
        const Counting::Turn turn(cycle_.statistics().counting);
        cycle_.run(now, 0);
        cycle_.setElapsed(cycle_.clock().period_ns);
    }
}

// Waits for the device that begins the cycles. The deadlines of its wait() are short, so that the
// loop adopts changes and sees a stop between them. A beat is expected a period after the last one;
// a beat that comes n periods later has missed n - 1.
Loop::WakeUp Loop::waitForSource(Source& device) noexcept {
    constexpr std::int64_t kPatience = 10'000'000;
    const FlightRecorder::RealtimeNotes notes = recorder_.realtimeNotes();
    notes.enterHook(device.context().recorder_slot, Hook::Wait);
    const bool ready = device.wait(monotonicNow() + kPatience);
    notes.leaveHook();
    waits_.add(1);
    const std::int64_t now = monotonicNow();
    if (!ready) {
        cycle_.atBoundary(now);
        return {false, 0, now};
    }
    const std::int64_t period = cycle_.clock().period_ns;
    const std::int64_t last = std::exchange(beat_ns_, now);
    if (last == 0) return {true, now, now};
    const std::int64_t periods = std::max<std::int64_t>(1, (now - last + period / 2) / period);
    cycle_.setElapsed(periods * period);
    return {true, last + periods * period, now, periods - 1};
}

Loop::WakeUp Loop::waitForClock(std::int64_t deadline_ns) noexcept {
    const std::int64_t spin = spin_ns_.load(std::memory_order_relaxed);
    const timespec until{(deadline_ns - spin) / kSecond, (deadline_ns - spin) % kSecond};
    // An absolute time, so that preemptions before the call do not add up (clock_nanosleep(2)).
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
    }
    for (const void* line : cycle_.schedule().footprint) __builtin_prefetch(line);
    std::int64_t now = monotonicNow();
    cycle_.statistics().wake_up.add(now - deadline_ns + spin);
    while (now < deadline_ns) now = monotonicNow();
    beat_ns_ = 0;  // no device paces this cycle
    return {true, deadline_ns, now};
}

void Loop::noteMissed(std::int64_t periods) noexcept RTCF_NONBLOCKING {
    if (periods > 0 && cycle_.statistics().counting.counts())
        bump(cycle_.statistics().missed, static_cast<std::uint64_t>(periods));
}

void Loop::noteOverrun(const WakeUp& wake_up, std::int64_t begin_ticks, std::int64_t end_ns,
                       bool behind) noexcept RTCF_NONBLOCKING {
    if (cycle_.statistics().counting.counts()) countOverrun(wake_up, begin_ticks, end_ns, behind);
    const std::uint32_t limit = max_overruns_.load(std::memory_order_relaxed);
    if (limit != 0 && ++bucket_ > limit && !cycle_.faulted())
        cycle_.endLoop(LoopFault::Kind::Overruns, nullptr, "too many overruns");
}

// Attributes an overrun to its cause. A cycle that took less than a period would have been in time
// if it had begun in time.
void Loop::countOverrun(const WakeUp& wake_up, std::int64_t begin_ticks, std::int64_t end_ns,
                        bool behind) noexcept RTCF_NONBLOCKING {
    LoopStatistics& statistics = cycle_.statistics();
    bump(statistics.overruns);
    const std::int64_t period = cycle_.clock().period_ns;
    if (end_ns - wake_up.wake_ns >= period) {
        cycle_.blame(begin_ticks, begin_ticks + cycle_.counter().toTicks(period));
    } else if (behind) {
        statistics.catching_up.add(1);
    } else {
        statistics.late_wake_ups.add(1);
    }
}

std::int64_t Loop::nextDeadline(std::int64_t deadline_ns, std::int64_t end_ns) noexcept
    RTCF_NONBLOCKING {
    const std::int64_t period = cycle_.clock().period_ns;
    const std::int64_t next = deadline_ns + period;
    if (end_ns < next) {
        cycle_.setElapsed(period);
        caught_up_ = 0;
        if (bucket_ > 0 && ++cycles_on_time_ % kBucketLeak == 0) --bucket_;
        return next;
    }
    switch (overrun_policy_.load(std::memory_order_relaxed)) {
        case OverrunPolicy::CatchUp:
            if (++caught_up_ > kMostCaughtUp) break;
            cycle_.setElapsed(period);
            return next;
        case OverrunPolicy::Relative:
            cycle_.setElapsed((end_ns + period - deadline_ns) / period * period);
            return end_ns + period;
        case OverrunPolicy::Skip:
            break;
    }
    caught_up_ = 0;
    const std::int64_t dropped = (end_ns - next) / period + 1;
    noteMissed(dropped);
    cycle_.setElapsed((dropped + 1) * period);
    return next + dropped * period;
}

}  // namespace rtcf::executor
