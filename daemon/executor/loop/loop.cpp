#include "loop/loop.hpp"

#include <fmt/format.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <optional>
#include <utility>

#include "common/c_locale.hpp"
#include "common/error.hpp"
#include "common/time_units.hpp"
#include "faults/crash_handler.hpp"
#include "logging/log.hpp"
#include "loop/patience.hpp"
#include "loop/simulated_clock.hpp"
#include "realtime/floating_point.hpp"

namespace rtcf::executor {

namespace {

class AdoptionWork final : public BoundaryWork {
   public:
    explicit AdoptionWork(Adoption& adoption) : adoption_(adoption) {}
    bool perform(Cycle& cycle) noexcept override {
        cycle.apply(adoption_);
        return true;
    }

   private:
    Adoption& adoption_;
};

class CaptureWork final : public BoundaryWork {
   public:
    explicit CaptureWork(Capture& capture) : capture_(capture) {}
    bool perform(Cycle& cycle) noexcept override {
        cycle.capture(capture_);
        return true;
    }

   private:
    Capture& capture_;
};

// Takes a few values at each boundary, so that no single cycle copies several large ones.
class ProbeWork final : public BoundaryWork {
   public:
    explicit ProbeWork(Probe& probe) : probe_(probe) {}
    bool perform(Cycle& cycle) noexcept override { return probe_.takeSome(cycle.clock()); }

   private:
    Probe& probe_;
};

// To an absolute time, so that preemptions before the call do not add up (clock_nanosleep(2)).
void sleepUntil(std::int64_t time_ns) noexcept {
    const timespec until{time_ns / kSecond, time_ns % kSecond};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
    }
}

// Cycles on time that remove one overrun from the bucket.
constexpr std::uint64_t kBucketLeak = 1000;
// Largest number of cycles in a row that CatchUp catches up: a freeze of the machine may have
// delayed many more.
constexpr std::uint32_t kMostCaughtUp = 100;

}  // namespace

Loop::Loop(Log& log, FlightRecorder& recorder, std::string cpu_claims)
    : cycle_(recorder), log_(log), recorder_(recorder), cpu_claims_(std::move(cpu_claims)) {
    log_.setIteration(&cycle_.statistics().iteration);
}

Loop::~Loop() {
    requestStop();
    join(INT64_MAX);
    log_.setIteration(nullptr);
}

void Loop::announce(Pace pace) {
    refreshWallClock();
    cycle_.announce(pace);
}

void Loop::reset(const LoopSettings& settings, std::uint64_t stops_known, Pace pace) {
    stops_known_ = stops_known;
    if (stopRequested()) {
        throw Error(ErrorKind::LoopStopped,
                    "the loop is not started: a stop was requested after the start");
    }
    cycle_.begin(settings.period_ns, settings.warmup_cycles, pace);
    bucket_ = 0;
    cycles_on_time_ = 0;
    caught_up_ = 0;
    beat_ns_ = 0;
    overload_ = {};
    stack_bytes_ = settings.realtime.stack_bytes;
}

RealtimeProblems Loop::start(const LoopSettings& settings, std::uint64_t stops_known) {
    RealtimeProblems problems;
    retune(settings);
    if (settings.clock == nullptr) refreshWallClock();
    reset(settings, stops_known, settings.clock == nullptr ? Pace::RealTime : Pace::Clock);
    simulation_ = settings.clock;
    if (simulation_ == nullptr) {
        idle_guard_ = std::make_unique<IdleStateGuard>();
        if (!idle_guard_->problem().empty()) problems.push_back({idle_guard_->problem(), false});
    }

    thread_locals_.emplace();
    try {
        const RealtimeSettings realtime = placed(settings.realtime, problems);
        const RealtimeAttributes attributes(realtime);
        running_.store(true, std::memory_order_release);
        joinable_.store(true, std::memory_order_release);
        const int error = pthread_create(&thread_, attributes.get(), &Loop::threadMain, this);
        if (error != 0) {
            throw Error(ErrorKind::NoRealtime,
                        fmt::format("cannot create the real-time thread: {} (CPU {}, priority {})",
                                    std::strerror(error), realtime.cpu, realtime.priority));
        }
    } catch (...) {
        cycle_.abandon();
        running_.store(false, std::memory_order_release);
        joinable_.store(false, std::memory_order_release);
        thread_locals_.reset();
        idle_guard_.reset();
        leaveCpu();
        throw;
    }
    return problems;
}

bool Loop::join(std::int64_t timeout_ns) {
    if (!joinable()) return true;
    if (timeout_ns != INT64_MAX) {
        Patience patience(timeout_ns);
        while (running()) {
            if (!patience.wait()) return false;
        }
    }
    // The thread ends right after it clears running_, so this join does not wait.
    if (pthread_join(thread_, nullptr) != 0) return false;
    joinable_.store(false, std::memory_order_release);
    thread_locals_.reset();
    idle_guard_.reset();
    leaveCpu();
    thread_id_.store(0, std::memory_order_relaxed);
    return true;
}

// Performs the work at a boundary of the running loop, or here if the loop does not run.
bool Loop::perform(BoundaryWork& work, std::int64_t timeout_ns) {
    Boundary& boundary = cycle_.boundary();
    boundary.offer(work);
    Patience patience(timeout_ns);
    while (boundary.pending()) {
        if (!running()) {
            if (!join(timeout_ns)) break;
            // The work may have come too late for the last cycle.
            const CrashRole crash_role(ThreadRole::Realtime);
            while (boundary.pending()) cycle_.atBoundary(nextStep());
            return true;
        }
        if (!patience.wait()) break;
    }
    return !boundary.withdraw(work);
}

bool Loop::adopt(Adoption& adoption, std::int64_t timeout_ns) {
    if (adoption.schedule != nullptr) {
        for (const Feed& feed : adoption.schedule->feeds)
            feed.injector->setAttention(cycle_.attention());
    }
    AdoptionWork work(adoption);
    return perform(work, timeout_ns);
}

bool Loop::capture(Capture& capture, std::int64_t timeout_ns) {
    CaptureWork work(capture);
    return perform(work, timeout_ns);
}

bool Loop::probe(Probe& probe, std::int64_t timeout_ns) {
    if (!joinable()) {
        probe.takeAll(clock());
        return true;
    }
    ProbeWork work(probe);
    return perform(work, timeout_ns);
}

void Loop::adoptInjections() {
    if (!joinable()) cycle_.feed();
}

RealtimeProblems Loop::retune(const LoopSettings& settings) {
    spin_ns_.store(settings.spin_ns, std::memory_order_relaxed);
    overrun_policy_.store(settings.overrun, std::memory_order_relaxed);
    max_overruns_.store(settings.max_overruns, std::memory_order_relaxed);
    if (!joinable() || simulation_ != nullptr) return {};
    RealtimeProblems problems;
    if (!idle_guard_->problem().empty()) problems.push_back({idle_guard_->problem(), false});
    const RealtimeSettings realtime = placed(settings.realtime, problems);
    for (RealtimeProblem& problem : applyToThread(thread_, realtime))
        problems.push_back(std::move(problem));
    return problems;
}

// Claims a CPU for the loop and moves other threads off it. Returns the settings with that CPU.
RealtimeSettings Loop::placed(RealtimeSettings settings, RealtimeProblems& problems) {
    if (!settings.wanted) return settings;
    const bool stays = cpu_claim_ != nullptr && (settings.cpu < 0 || settings.cpu == cpu());
    if (!stays) {
        cpu_claim_.reset();
        cpu_claim_ = std::make_unique<CpuClaim>(settings.cpu, cpu_claims_);
        cpu_.store(cpu_claim_->cpu(), std::memory_order_relaxed);
        other_threads_.keepOff(cpu(), threadId());
    }
    if (!cpu_claim_->alone()) {
        problems.push_back(
            {fmt::format("CPU {} also runs another loop, each may delay the other: "
                         "choose another CPU for one of them (rtcfctl runner set NAME --cpu N)",
                         cpu()),
             false});
    }
    settings.cpu = cpu();
    return settings;
}

void Loop::leaveCpu() {
    other_threads_.release();
    cpu_claim_.reset();
    cpu_.store(-1, std::memory_order_relaxed);
}

void Loop::refreshWallClock() noexcept {
    if (joinable() && simulation_ != nullptr) return;  // the simulated clock sets the stamps
    cycle_.setStampOffset(realtimeOffset());
}

void* Loop::threadMain(void* self) {
    static_cast<Loop*>(self)->run();
    return nullptr;
}

void Loop::run() noexcept {
    Log::setRealtimeThread(true);
    const CrashContext crash_context(ThreadRole::Realtime);
    pthread_setname_np(pthread_self(), "rtcf-loop");
    useCLocale();
    thread_id_.store(static_cast<int>(syscall(SYS_gettid)), std::memory_order_relaxed);
    setFloatingPointDefaults();
    prefaultStack(stack_bytes_);
    thread_locals_->touch();
    recorder_.setRunning(true);
    if (simulation_ == nullptr) {
        followRealTime();
        cycle_.makeSafe(afterLastCycle(monotonicNow()));
    } else {
        followClock();
        endStepping();
    }
    recorder_.setRunning(false);
    running_.store(false, std::memory_order_release);
}

void Loop::beginStepping(const LoopSettings& settings, std::uint64_t stops_known,
                         std::int64_t stamp_ns) {
    reset(settings, stops_known, Pace::Steps);
    cycle_.setStampOffset(stamp_ns - nextStep());
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
        if (!cycle_.run(nextStep(), 0)) break;
        cycle_.settle();
        // A snapshot may have restored another elapsed time, and the period may have changed.
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

// Loop time of the next simulated cycle: advances by a period each cycle, from 0.
std::int64_t Loop::nextStep() const noexcept {
    return cycle_.clock().time_ns + cycle_.clock().period_ns;
}

// Loop time rises strictly, even if a coarse clock shows the same time twice. It rises by at least
// 2 ns, because takeOver() at a boundary writes with a stamp 1 ns before that of the cycle.
std::int64_t Loop::afterLastCycle(std::int64_t time_ns) const noexcept {
    return std::max(time_ns, cycle_.clock().time_ns + 2);
}

// The component whose device paces the loop; null = none, the clock does.
Source* Loop::source() const noexcept {
    Source* const source = cycle_.schedule().source;
    return source != nullptr && !accessTo(*source).context().disabled ? source : nullptr;
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
        const std::int64_t begin = readCycleCounter();
        const std::int64_t time =
            device != nullptr ? afterLastCycle(wake_up.wake_ns) : wake_up.deadline_ns;
        if (!cycle_.run(time, wake_up.wake_ns - wake_up.deadline_ns)) break;
        noteMissed(wake_up.missed);
        // A device begins the next cycle itself; waitForSource() counts missed beats.
        const std::int64_t limit = time + cycle_.clock().period_ns;
        end = endOfCycle(wake_up, begin, limit);
        const bool late = end >= limit;
        if (late) noteOverrun(wake_up, begin, end, behind);
        const std::int64_t rest = overload_.rest(wake_up.wake_ns, end, late);
        if (rest != 0) rests_.add(1);
        deadline = device != nullptr ? limit : nextDeadline(wake_up.deadline_ns, end, rest);
        cycle_.settle();
        if (rest != 0 && device != nullptr) sleepUntil(end + rest);
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
        cycle_.run(now, 0);
        cycle_.settle();
        cycle_.setElapsed(cycle_.clock().period_ns);
    }
}

// Waits for the device that begins the cycles. The deadlines of its wait() are short, so that the
// loop adopts changes and sees a stop between them. A beat is expected a period after the last one;
// if it comes n periods after the last one, n - 1 beats were missed.
Loop::WakeUp Loop::waitForSource(Source& device) noexcept {
    constexpr std::int64_t kPatience = 10'000'000;
    const FlightRecorder::RealtimeNotes notes = recorder_.realtimeNotes();
    notes.enterHook(accessTo(device).context().recorder_slot, Hook::Wait);
    const bool ready = device.wait(monotonicNow() + kPatience);
    notes.leaveHook();
    waits_.add(1);
    const std::int64_t now = monotonicNow();
    if (!ready) {
        cycle_.atBoundary(afterLastCycle(now));
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
    sleepUntil(deadline_ns - spin);
    for (const void* line : cycle_.schedule().footprint) __builtin_prefetch(line);
    std::int64_t now = monotonicNow();
    cycle_.statistics().wake_up.add(now - deadline_ns + spin);
    while (now < deadline_ns) now = monotonicNow();
    beat_ns_ = 0;  // no device paces this cycle
    return {true, deadline_ns, now};
}

void Loop::noteMissed(std::int64_t periods) noexcept RTCF_NONBLOCKING {
    if (periods > 0) cycle_.statistics().missed.add(static_cast<std::uint64_t>(periods));
}

void Loop::noteOverrun(const WakeUp& wake_up, std::int64_t begin_ticks, std::int64_t end_ns,
                       bool behind) noexcept RTCF_NONBLOCKING {
    countOverrun(wake_up, begin_ticks, end_ns, behind);
    const std::uint32_t limit = max_overruns_.load(std::memory_order_relaxed);
    if (limit != 0 && ++bucket_ > limit && !cycle_.faulted())
        cycle_.endLoop(LoopFault::Kind::Overruns, nullptr, "too many overruns");
}

// Attributes an overrun to its cause. A cycle that took less than a period would have been in time
// if it had begun in time.
void Loop::countOverrun(const WakeUp& wake_up, std::int64_t begin_ticks, std::int64_t end_ns,
                        bool behind) noexcept RTCF_NONBLOCKING {
    LoopStatistics& statistics = cycle_.statistics();
    statistics.overruns.add(1);
    const std::int64_t period = cycle_.clock().period_ns;
    if (end_ns - wake_up.wake_ns >= period) {
        cycle_.blame(begin_ticks + cycle_.counter().toTicks(period));
    } else if (behind) {
        statistics.catching_up.add(1);
    } else {
        statistics.late_wake_ups.add(1);
    }
}

std::int64_t Loop::nextDeadline(std::int64_t deadline_ns, std::int64_t end_ns,
                                std::int64_t rest_ns) noexcept RTCF_NONBLOCKING {
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
            if (++caught_up_ > kMostCaughtUp || rest_ns != 0) break;
            cycle_.setElapsed(period);
            return next;
        case OverrunPolicy::Relative:
            end_ns += std::max(period, rest_ns);
            cycle_.setElapsed((end_ns - deadline_ns) / period * period);
            return end_ns;
        case OverrunPolicy::Skip:
            break;
    }
    caught_up_ = 0;
    const std::int64_t missed = (end_ns + rest_ns - next) / period + 1;
    noteMissed(missed);
    cycle_.setElapsed((missed + 1) * period);
    return next + missed * period;
}

}  // namespace rtcf::executor
