#include "loop/loop.hpp"

#include <fmt/format.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include <cstring>

#include "common/error.hpp"
#include "faults/crash_handler.hpp"
#include "logging/log.hpp"
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

void Loop::reset(const LoopSettings& settings, std::uint64_t stops_known) {
    stops_known_ = stops_known;
    if (stopRequested()) {
        throw Error(ErrorKind::LoopStopped,
                    "the loop is not started: a stop was requested after the start");
    }
    cycle_.begin(settings.period_ns, settings.warmup_cycles);
    bucket_ = 0;
    cycles_on_time_ = 0;
    caught_up_ = 0;
    beat_ns_ = 0;
    stack_bytes_ = settings.realtime.stack_bytes;
}

RealtimeProblems Loop::start(const LoopSettings& settings, std::uint64_t stops_known) {
    RealtimeProblems problems;
    retune(settings);
    reset(settings, stops_known);
    simulation_ = settings.clock;
    if (simulation_ == nullptr) {
        refreshWallClock();
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
        const std::int64_t until = monotonicNow() + timeout_ns;
        while (running()) {
            if (monotonicNow() > until) return false;
            const timespec pause{0, 100'000};
            nanosleep(&pause, nullptr);
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
    const std::int64_t until = monotonicNow() + timeout_ns;
    while (boundary.pending()) {
        if (!running()) {
            if (!join(timeout_ns)) break;
            // The work may have come too late for the last cycle.
            const CrashRole crash_role(ThreadRole::Realtime);
            while (boundary.pending()) cycle_.atBoundary(nextStep());
            return true;
        }
        if (monotonicNow() > until) break;
        const timespec pause{0, 100'000};
        nanosleep(&pause, nullptr);
    }
    return !boundary.withdraw(work);
}

bool Loop::adopt(Adoption& adoption, std::int64_t timeout_ns) {
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

bool Loop::popRecord(CycleRecord& record) {
    const CycleRecord* front = cycle_.records().front();
    if (front == nullptr) return false;
    record = *front;
    cycle_.records().pop();
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
    setFloatingPointDefaults();
    prefaultStack(stack_bytes_);
    thread_locals_->touch();
    recorder_.setRunning(true);
    if (simulation_ == nullptr) {
        followRealTime();
        cycle_.makeSafe(monotonicNow());
    } else {
        followClock();
        endStepping();
    }
    recorder_.setRunning(false);
    running_.store(false, std::memory_order_release);
}

}  // namespace rtcf::executor
