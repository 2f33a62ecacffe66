#include "runner/simulation.hpp"

#include <fmt/format.h>

#include <chrono>
#include <optional>
#include <thread>

namespace rtcf::executor {

namespace {

constexpr auto kBridgePatience = std::chrono::seconds(2);

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

void Simulation::reportJumps(const ReportEvent& report_event) {
    while (const std::optional<ClockJump> jump = clock_->takeJump()) {
        const double to = static_cast<double>(jump->to_ns) / 1e9;
        std::string message = fmt::format("the simulated clock begins at {:.9f} s", to);
        if (jump->from_ns) {
            message = fmt::format(
                "the simulated clock jumped from {:.9f} s to {:.9f} s: the loop "
                "continues from there with one cycle",
                static_cast<double>(*jump->from_ns) / 1e9, to);
        }
        report_event({RunnerEvent::Kind::Clock,
                      message,
                      {},
                      loop_.statistics().iteration.load(std::memory_order_relaxed)});
    }
}

}  // namespace rtcf::executor
