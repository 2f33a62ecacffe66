#include "loop/loop.hpp"

#include <fmt/format.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <exception>
#include <optional>

#include "faults/crash_handler.hpp"
#include "logging/log.hpp"
#include "loop/simulated_clock.hpp"
#include "refusal.hpp"

namespace rtcf::executor {

namespace {

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::uint64_t kBucketLeak = 1000;  // cycles on time that make good one overrun

std::int64_t clockNow(clockid_t clock) {
    timespec now{};
    clock_gettime(clock, &now);
    return std::int64_t{now.tv_sec} * kSecond + now.tv_nsec;
}

timespec toTimespec(std::int64_t ns) { return {ns / kSecond, ns % kSecond}; }

void bump(std::atomic<std::uint64_t>& counter, std::uint64_t by = 1) {
    counter.store(counter.load(std::memory_order_relaxed) + by, std::memory_order_relaxed);
}

}  // namespace

Loop::Loop(Log& log, FlightRecorder& recorder)
    : schedule_(&empty_),
      notes_(recorder.realtimeNotes()),
      log_(log),
      recorder_(recorder),
      counter_(CycleCounter::calibrate()) {
    log_.setIteration(&figures_.iteration);
}

Loop::~Loop() {
    requestStop();
    join(INT64_MAX);
    log_.setIteration(nullptr);
}

void Loop::reset(const LoopSettings& settings) {
    clock_.iteration = 0;
    clock_.time_ns = 0;
    clock_.stamp_ns = 0;
    clock_.period_ns = settings.period_ns;
    elapsed_ns_ = settings.period_ns;
    total_elapsed_ns_ = 0;
    warmup_cycles_ = settings.warmup_cycles;
    any_disabled_ = false;
    for (const Step& step : schedule_->steps) {
        step.context->period_ns = settings.period_ns * step.every;
        step.context->updated_ns = -1;
        step.context->disabled = false;
    }
    noteSchedule();
    figures_.iteration.store(0, std::memory_order_relaxed);
    bucket_ = 0;
    cycles_on_time_ = 0;
    fault_ = {};
    stack_bytes_ = settings.realtime.stack_bytes;
    stop_requested_.store(false, std::memory_order_release);
}

void Loop::beginStepping(const LoopSettings& settings, std::int64_t stamp_ns) {
    reset(settings);
    stamp_offset_ns_.store(stamp_ns, std::memory_order_relaxed);
}

std::uint64_t Loop::step(std::uint64_t cycles) noexcept {
    std::uint64_t done = 0;
    // Components log as in any cycle; there is no other thread that runs one.
    Log::setRealtimeThread(true);
    for (; done < cycles; ++done) {
        if (stop_requested_.load(std::memory_order_acquire)) break;
        if (fault_.kind != LoopFault::Kind::None) break;
        const std::int64_t period = clock_.period_ns;
        const std::int64_t now = clock_.time_ns + (clock_.iteration == 0 ? 0 : period);
        cycle(now, now);
    }
    Log::setRealtimeThread(false);
    return done;
}

RealtimeProblems Loop::start(const LoopSettings& settings) {
    RealtimeProblems problems;
    retune(settings);
    reset(settings);
    simulation_ = settings.clock;
    if (simulation_ == nullptr) {
        refreshWallClock();
        idle_guard_ = std::make_unique<IdleStateGuard>();
        if (!idle_guard_->problem().empty()) problems.push_back({idle_guard_->problem(), false});
    }

    running_.store(true, std::memory_order_release);
    joinable_.store(true, std::memory_order_release);
    const RealtimeAttributes attributes(settings.realtime);
    if (const int error = pthread_create(&thread_, attributes.get(), &Loop::threadMain, this);
        error != 0) {
        running_.store(false, std::memory_order_release);
        joinable_.store(false, std::memory_order_release);
        idle_guard_.reset();
        throw Refusal(
            RefusalKind::FailedPrecondition,
            fmt::format("no real-time thread: {} (CPU {}, priority {})", std::strerror(error),
                        chooseCpu(settings.realtime), settings.realtime.priority));
    }
    return problems;
}

bool Loop::join(std::int64_t timeout_ns) {
    if (!joinable()) return true;
    if (timeout_ns != INT64_MAX) {
        const std::int64_t until = clockNow(CLOCK_MONOTONIC) + timeout_ns;
        while (running()) {
            if (clockNow(CLOCK_MONOTONIC) > until) return false;
            const timespec pause{0, 100'000};
            nanosleep(&pause, nullptr);
        }
    }
    // Not running any more is the last thing it does, so that this takes no time.
    if (pthread_join(thread_, nullptr) != 0) return false;
    joinable_.store(false, std::memory_order_release);
    idle_guard_.reset();
    thread_id_.store(0, std::memory_order_relaxed);
    // A change that came too late for the last cycle is made here.
    takeAdoption();
    return true;
}

bool Loop::adopt(Adoption& adoption, std::int64_t timeout_ns) {
    pending_.store(&adoption, std::memory_order_release);
    const std::int64_t until = clockNow(CLOCK_MONOTONIC) + timeout_ns;
    while (pending_.load(std::memory_order_acquire) != nullptr) {
        if (!running()) {
            if (!join(timeout_ns)) break;
            takeAdoption();
            return true;
        }
        if (clockNow(CLOCK_MONOTONIC) > until) break;
        const timespec pause{0, 100'000};
        nanosleep(&pause, nullptr);
    }
    Adoption* expected = &adoption;
    if (pending_.compare_exchange_strong(expected, nullptr, std::memory_order_acq_rel))
        return false;
    // The loop has got to it after all: it is done in a moment.
    while (pending_.load(std::memory_order_acquire) != nullptr) sched_yield();
    return true;
}

void Loop::adoptInjections() {
    if (!joinable()) feed();
}

RealtimeProblems Loop::retune(const LoopSettings& settings) {
    spin_ns_.store(settings.spin_ns, std::memory_order_relaxed);
    overrun_policy_.store(settings.overrun, std::memory_order_relaxed);
    max_overruns_.store(settings.max_overruns, std::memory_order_relaxed);
    if (!joinable() || simulation_ != nullptr) return {};
    return applyToThread(thread_, settings.realtime);
}

void Loop::refreshWallClock() noexcept {
    if (joinable() && simulation_ != nullptr) return;  // stamps are the simulation's
    stamp_offset_ns_.store(clockNow(CLOCK_REALTIME) - clockNow(CLOCK_MONOTONIC),
                           std::memory_order_relaxed);
}

bool Loop::popRecord(CycleRecord& record) {
    const CycleRecord* front = records_.front();
    if (front == nullptr) return false;
    record = *front;
    records_.pop();
    return true;
}

bool Loop::popFault(ComponentFault& fault) {
    const ComponentFault* front = faults_.front();
    if (front == nullptr) return false;
    fault = *front;
    faults_.pop();
    return true;
}

void* Loop::threadMain(void* self) {
    static_cast<Loop*>(self)->run();
    return nullptr;
}

void Loop::run() noexcept {
    Log::setRealtimeThread(true);
    const CrashContext crash_context(ThreadRole::Realtime);
    pthread_setname_np(pthread_self(), "rtcf-loop");
    thread_id_.store(static_cast<int>(syscall(SYS_gettid)), std::memory_order_relaxed);
    prefaultStack(stack_bytes_);
    recorder_.setRunning(true);
    if (simulation_ == nullptr) {
        followRealTime();
    } else {
        followClock();
    }
    makeSafe();
    recorder_.setRunning(false);
    running_.store(false, std::memory_order_release);
}

void Loop::followRealTime() noexcept {
    std::int64_t deadline = clockNow(CLOCK_MONOTONIC) + clock_.period_ns;
    while (!stop_requested_.load(std::memory_order_acquire) &&
           fault_.kind == LoopFault::Kind::None) {
        std::int64_t wake = 0;
        if (Source* source = schedule_->source; source != nullptr) {
            wake = waitForSource(*source);
            deadline = wake;
            if (stop_requested_.load(std::memory_order_acquire)) break;
        } else {
            wake = waitFor(deadline);
        }
        const std::int64_t begin = readCycleCounter();
        cycle(deadline, wake);
        const std::int64_t end = wake + counter_.toNs(readCycleCounter() - begin);
        const std::int64_t limit = deadline + clock_.period_ns;
        if (end >= limit) blameOverrun(begin, begin + counter_.toTicks(limit - wake));
        deadline = nextDeadline(deadline, end);
    }
}

// Components' time() goes on by a period each cycle, whatever the simulated clock does; stamps are
// the clock's.
void Loop::followClock() noexcept {
    constexpr auto kPatience = std::chrono::milliseconds(10);
    while (!stop_requested_.load(std::memory_order_acquire) &&
           fault_.kind == LoopFault::Kind::None) {
        const std::optional<SimulatedCycle> due = simulation_->next(clock_.period_ns, kPatience);
        if (!due) {
            takeProbe();
            takeAdoption();
            continue;
        }
        for (const Feed& feed : schedule_->feeds) feed.injector->deliverUntil(due->arrived_ns);
        const std::int64_t now = clock_.iteration == 0 ? 0 : clock_.time_ns + clock_.period_ns;
        stamp_offset_ns_.store(due->time_ns - now, std::memory_order_relaxed);
        cycle(now, now);
    }
}

// The device says when a cycle begins. Changes are taken over and a request to stop is seen
// between its deadlines, which are never far away.
std::int64_t Loop::waitForSource(Source& source) noexcept {
    constexpr std::int64_t kPatience = 10'000'000;
    while (!stop_requested_.load(std::memory_order_acquire)) {
        if (source.wait(monotonicNow() + kPatience)) break;
        takeProbe();
        if (pending_.load(std::memory_order_relaxed) != nullptr) {
            takeAdoption();
            if (schedule_->source != &source) break;
        }
    }
    return monotonicNow();
}

std::int64_t Loop::waitFor(std::int64_t deadline_ns) noexcept {
    const std::int64_t spin = spin_ns_.load(std::memory_order_relaxed);
    const timespec until = toTimespec(deadline_ns - spin);
    // Absolute, so that a preemption before the call does not add up (clock_nanosleep(2)).
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
    }
    for (const void* line : schedule_->footprint) __builtin_prefetch(line);
    std::int64_t now = monotonicNow();
    figures_.wake_up.add(now - deadline_ns + spin);
    while (now < deadline_ns) now = monotonicNow();
    return now;
}

void Loop::cycle(std::int64_t deadline_ns, std::int64_t wake_ns) noexcept RTCF_NONBLOCKING {
    const std::int64_t begin = readCycleCounter();
    if (requested()) {
        takeProbe();
        takeAdoption();
    }
    const Schedule& schedule = *schedule_;
    const FlightRecorder::RealtimeNotes notes = notes_;
    clock_.time_ns = deadline_ns;
    clock_.stamp_ns = deadline_ns + stamp_offset_ns_.load(std::memory_order_relaxed);
    if (exchanges_) {
        feed();
        for (const Latch& latch : schedule.latches) latch.copy();
    }
    const std::uint64_t iteration = clock_.iteration;
    notes.setIteration(iteration);
    const bool complete = iteration >= plain_from_ ? update<true>(schedule, notes, begin)
                                                   : updateSelected(schedule, begin);
    notes.leaveComponents();
    if (exchanges_ && complete) {
        for (Tap* tap : schedule.taps) tap->push();
    }
    const std::int64_t duration = readCycleCounter() - begin;
    if (iteration >= warmup_cycles_) {
        figures_.duration.add(duration);
        figures_.latency.add(wake_ns - deadline_ns);
    }
    if (CycleRecord* record = records_.claim()) {
        *record = {iteration, clock_.stamp_ns, wake_ns - deadline_ns, counter_.toNs(duration)};
        records_.commit();
    }
    clock_.iteration = iteration + 1;
    figures_.iteration.store(iteration + 1, std::memory_order_relaxed);
}

// The one frame that catches: a component may throw, the loop may not. `Plain` leaves out what
// most graphs do not have, so that it costs them nothing.
template <bool Plain>
[[gnu::always_inline]] inline bool Loop::update(const Schedule& schedule,
                                                FlightRecorder::RealtimeNotes notes,
                                                std::int64_t begin_ticks) noexcept {
    std::int64_t before = begin_ticks;
    const Step* running = nullptr;
    try {
        for (const Step& step : schedule.steps) {
            if (!Plain && !due(step)) continue;
            running = &step;
            notes.enterComponent(step.slot);
            step.component->update();
            if (!Plain) commitFinite(step);
            const std::int64_t after = readCycleCounter();
            const std::int64_t duration = after - before;
            before = after;
            step.ended_ticks = after;
            if (Plain || clock_.iteration >= warmup_cycles_) step.figures->duration.add(duration);
        }
        return true;
    } catch (const std::exception& error) {
        componentFailed(LoopFault::Kind::Exception, *running, error.what());
    } catch (...) {
        componentFailed(LoopFault::Kind::Exception, *running, "an exception of unknown type");
    }
    return false;
}

// Cycles in which not all is plain; a function of its own, as it needs registers that the others do
// not.
[[gnu::noinline]] bool Loop::updateSelected(const Schedule& schedule,
                                            std::int64_t begin_ticks) noexcept {
    total_elapsed_ns_ += elapsed_ns_;
    return update<false>(schedule, notes_, begin_ticks);
}

// Whether a component runs in this cycle; then its clock is set.
bool Loop::due(const Step& step) const noexcept RTCF_NONBLOCKING {
    ComponentContext& context = *step.context;
    if (context.disabled || clock_.iteration % step.every != step.phase) return false;
    const bool again = context.updated_ns >= 0 && step.every != 1;
    context.elapsed_ns =
        again ? total_elapsed_ns_ - context.updated_ns : std::max(elapsed_ns_, context.period_ns);
    context.updated_ns = total_elapsed_ns_;
    return true;
}

void Loop::commitFinite(const Step& step) noexcept RTCF_NONBLOCKING {
    for (OutputBase* output : step.component->finiteOutputs()) {
        if (output->commitFinite()) continue;
        if (output->nonFinitePolicy() == OnNonFinite::Stop) {
            noteFault(LoopFault::Kind::NotFinite, step.component, output->name().c_str());
        } else {
            reportFault(LoopFault::Kind::NotFinite, step.component, output->name().c_str());
        }
    }
}

void Loop::componentFailed(LoopFault::Kind kind, const Step& step, const char* text) noexcept {
    if (!step.optional) {
        noteFault(kind, step.component, text);
        return;
    }
    step.context->disabled = true;
    any_disabled_ = true;
    noteSchedule();
    reportFault(kind, step.component, text);
}

void Loop::reportFault(LoopFault::Kind kind, const Component* component,
                       const char* text) noexcept {
    ComponentFault* fault = faults_.claim();
    if (fault == nullptr) return;  // there are many of them already
    *fault = {};
    fault->kind = kind;
    fault->component = component;
    fault->iteration = clock_.iteration;
    std::strncpy(fault->text.data(), text, fault->text.size() - 1);
    faults_.commit();
}

void Loop::noteFault(LoopFault::Kind kind, const Component* component, const char* text) noexcept {
    fault_.kind = kind;
    fault_.component = component;
    if (component != nullptr) {
        std::strncpy(fault_.component_name.data(), component->fullName().c_str(),
                     fault_.component_name.size() - 1);
    }
    fault_.iteration = clock_.iteration;
    std::strncpy(fault_.text.data(), text, fault_.text.size() - 1);
}

void Loop::takeAdoption() noexcept RTCF_NONBLOCKING {
    Adoption* adoption = pending_.load(std::memory_order_acquire);
    if (adoption == nullptr) return;
    // Claimed before it is applied, so that the graph thread cannot take it back meanwhile.
    if (!pending_.compare_exchange_strong(adoption, &claimed_, std::memory_order_acq_rel)) return;
    const std::int64_t begin = readCycleCounter();
    adoption->apply();
    if (adoption->schedule != nullptr) schedule_ = adoption->schedule;
    if (adoption->period_ns != 0) {
        clock_.period_ns = adoption->period_ns;
        elapsed_ns_ = adoption->period_ns;
    }
    for (const Step& step : schedule_->steps)
        step.context->period_ns = clock_.period_ns * step.every;
    noteSchedule();
    figures_.adoption.add(readCycleCounter() - begin);
    pending_.store(nullptr, std::memory_order_release);
}

// What a cycle has to look at, decided once for all cycles until the schedule changes.
void Loop::noteSchedule() noexcept RTCF_NONBLOCKING {
    plain_from_ = schedule_->plain && !any_disabled_ ? warmup_cycles_ : UINT64_MAX;
    for (const Step& step : schedule_->steps) step.context->elapsed_ns = elapsed_ns_;
    exchanges_ =
        !schedule_->feeds.empty() || !schedule_->latches.empty() || !schedule_->taps.empty();
}

// Components learn of it when it changes: after an overrun, and in the cycle after that.
void Loop::setElapsed(std::int64_t elapsed_ns) noexcept RTCF_NONBLOCKING {
    if (elapsed_ns == elapsed_ns_) return;
    elapsed_ns_ = elapsed_ns;
    for (const Step& step : schedule_->steps) step.context->elapsed_ns = elapsed_ns;
}

bool Loop::probe(Probe& probe, std::int64_t timeout_ns) {
    if (!joinable()) {
        probe.take(clock_);
        return true;
    }
    probe_.store(&probe, std::memory_order_release);
    const std::int64_t until = clockNow(CLOCK_MONOTONIC) + timeout_ns;
    while (probe_.load(std::memory_order_acquire) != nullptr && running() &&
           clockNow(CLOCK_MONOTONIC) < until) {
        const timespec pause{0, 100'000};
        nanosleep(&pause, nullptr);
    }
    Probe* expected = &probe;
    if (probe_.compare_exchange_strong(expected, nullptr, std::memory_order_acq_rel)) return false;
    while (probe_.load(std::memory_order_acquire) != nullptr) sched_yield();
    return true;
}

bool Loop::requested() const noexcept RTCF_NONBLOCKING {
    // Both at once: nearly every cycle finds neither.
    return (reinterpret_cast<std::uintptr_t>(probe_.load(std::memory_order_relaxed)) |
            reinterpret_cast<std::uintptr_t>(pending_.load(std::memory_order_relaxed))) != 0;
}

void Loop::takeProbe() noexcept RTCF_NONBLOCKING {
    Probe* probe = probe_.load(std::memory_order_relaxed);
    if (probe == nullptr || probe == &claimed_probe_) return;
    if (!probe_.compare_exchange_strong(probe, &claimed_probe_, std::memory_order_acq_rel)) return;
    probe->take(clock_);
    probe_.store(nullptr, std::memory_order_release);
}

void Loop::feed() noexcept RTCF_NONBLOCKING {
    for (const Feed& feed : schedule_->feeds) {
        if (!feed.injector->adopt(clock_)) continue;
        for (InputBase* input : feed.readers) input->inject(feed.injector->front());
    }
}

// Counts an overrun for the component that was running when the next cycle should have begun.
void Loop::blameOverrun(std::int64_t begin_ticks, std::int64_t limit_ticks) noexcept
    RTCF_NONBLOCKING {
    for (const Step& step : schedule_->steps) {
        if (step.ended_ticks < begin_ticks || step.ended_ticks <= limit_ticks)
            continue;  // not now, or in time
        bump(step.figures->overruns);
        return;
    }
}

std::int64_t Loop::nextDeadline(std::int64_t deadline_ns, std::int64_t end_ns) noexcept
    RTCF_NONBLOCKING {
    const std::int64_t period = clock_.period_ns;
    const std::int64_t next = deadline_ns + period;
    if (end_ns < next) {
        setElapsed(period);
        if (bucket_ > 0 && ++cycles_on_time_ % kBucketLeak == 0) --bucket_;
        return next;
    }
    bump(figures_.overruns);
    const std::uint32_t limit = max_overruns_.load(std::memory_order_relaxed);
    if (limit != 0 && ++bucket_ > limit && fault_.kind == LoopFault::Kind::None) {
        noteFault(LoopFault::Kind::Overruns, nullptr, "too many overruns");
    }
    switch (overrun_policy_.load(std::memory_order_relaxed)) {
        case OverrunPolicy::CatchUp:
            setElapsed(period);
            return next;
        case OverrunPolicy::Relative:
            setElapsed((end_ns + period - deadline_ns) / period * period);
            return end_ns + period;
        case OverrunPolicy::Skip:
            break;
    }
    const std::int64_t dropped = (end_ns - next) / period + 1;
    bump(figures_.missed, static_cast<std::uint64_t>(dropped));
    setElapsed((dropped + 1) * period);
    return next + dropped * period;
}

void Loop::makeSafe() noexcept {
    // Not of one that threw: nobody knows what state that left it in.
    const bool threw = fault_.kind == LoopFault::Kind::Exception;
    for (const Step& step : schedule_->steps) {
        if (threw && step.component == fault_.component) continue;
        if (!step.context->disabled) step.component->safe();
    }
}

}  // namespace rtcf::executor
