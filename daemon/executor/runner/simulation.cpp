#include "runner/simulation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <thread>

#include "common/time_units.hpp"
#include "realtime/cycle_counter.hpp"

namespace rtcf::executor {

namespace {

constexpr auto kBridgePatience = std::chrono::seconds(2);
constexpr std::int64_t kClockSilence = 3 * kSecond;
// Interval between two summaries, and jumps in it that have a line of their own.
constexpr std::int64_t kSummaryInterval = 10 * kSecond;
constexpr std::uint64_t kMostClockJumps = 5;

double seconds(std::int64_t ns) { return static_cast<double>(ns) / 1e9; }

}  // namespace

bool Simulation::wanted(const RunnerSettings& settings, const Progress& progress,
                        const std::function<void()>& require_go) const {
    if (!bridge_.exists() || !settings.bridge.enabled || settings.sim_time == SimTime::Never)
        return false;
    if (settings.sim_time == SimTime::Always) return true;
    progress("asking the ROS master for /use_sim_time");
    const auto until = std::chrono::steady_clock::now() + kBridgePatience;
    while (std::chrono::steady_clock::now() < until && !ending_) {
        require_go();
        const BridgeStatus status = bridge_.status();
        if (status.simulated_time) return *status.simulated_time;
        if (!status.connected && !status.problem.empty()) return false;  // there is no master
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return false;
}

void Simulation::begin(RunnerSettings& settings, const Plan& plan) {
    clock_->reset(settings.max_clock_jump_ns);
    begun_ns_ = monotonicNow();
    jumps_ = 0;
    steps_ = {};
    steps_reported_ns_ = 0;
    silence_reported_ = false;
    set(true, settings, plan);
    if (!bridge_.exists()) return;
    const auto until = std::chrono::steady_clock::now() + kBridgePatience;
    while (!bridge_.status().follows_clock && std::chrono::steady_clock::now() < until && !ending_)
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
}

void Simulation::end(RunnerSettings& settings, const Plan& plan) { set(false, settings, plan); }

void Simulation::set(bool active, RunnerSettings& settings, const Plan& plan) {
    active_ = active;
    settings.loop.clock = active ? clock_ : nullptr;
    settings.loop.realtime.wanted = !active;
    if (!bridge_.exists()) return;
    for (const auto& injector : plan.bridgeTable().inputs) injector->setQueueing(active);
    bridge_.setClock(settings.loop.clock);
}

std::string Simulation::silence() const {
    if (!active_) return {};
    const std::optional<std::int64_t> moved = clock_->lastMove();
    const std::int64_t length_ns = monotonicNow() - moved.value_or(begun_ns_);
    if (length_ns < kClockSilence) return {};
    const std::int64_t length_s = length_ns / kSecond;
    const std::optional<std::int64_t> now = clock_->now();
    if (!moved || !now)
        return fmt::format("no cycle runs: no message on /clock for {} s", length_s);
    return fmt::format("no cycle runs: /clock has been at {:.9f} s for {} s", seconds(*now),
                       length_s);
}

void Simulation::report(const ReportEvent& report_event, bool last) {
    while (const std::optional<ClockJump> jump = clock_->takeJump())
        reportJump(*jump, report_event);
    const std::int64_t now = monotonicNow();
    if (jumps_ != 0 && (last || now - jumps_begun_ns_ >= kSummaryInterval)) {
        if (jumps_ > kMostClockJumps)
            send(fmt::format("the simulated clock jumped {} more times", jumps_ - kMostClockJumps),
                 report_event);
        jumps_ = 0;
    }
    const ClockSteps steps = clock_->takeSteps();
    steps_.count += steps.count;
    steps_.longest_ns = std::max(steps_.longest_ns, steps.longest_ns);
    if (steps_.count != 0 && (last || now - steps_reported_ns_ >= kSummaryInterval)) {
        send(fmt::format("the simulated clock went back {}, by {:.9f} s at most: the loop waited "
                         "until it had caught up",
                         steps_.count == 1 ? "once" : fmt::format("{} times", steps_.count),
                         seconds(steps_.longest_ns)),
             report_event);
        steps_ = {};
        steps_reported_ns_ = now;
    }
    const std::string silent = silence();
    if (!silent.empty() && !silence_reported_) send(silent, report_event);
    silence_reported_ = !silent.empty();
}

void Simulation::reportJump(const ClockJump& jump, const ReportEvent& report_event) {
    if (jumps_ == 0) jumps_begun_ns_ = monotonicNow();
    if (++jumps_ > kMostClockJumps) return;
    if (jump.from_ns) {
        send(fmt::format("the simulated clock jumped from {:.9f} s to {:.9f} s: the loop "
                         "continues from there with one cycle",
                         seconds(*jump.from_ns), seconds(jump.to_ns)),
             report_event);
    } else {
        send(fmt::format("the simulated clock begins at {:.9f} s", seconds(jump.to_ns)),
             report_event);
    }
}

void Simulation::send(const std::string& message, const ReportEvent& report_event) const {
    report_event({RunnerEvent::Kind::Clock,
                  message,
                  {},
                  loop_.statistics().iteration.load(std::memory_order_relaxed)});
}

}  // namespace rtcf::executor
