// Runner: simulated clock.
#include <fmt/format.h>

#include <chrono>

#include "runner/runner.hpp"

namespace rtcf::executor {

namespace {

constexpr auto kBridgePatience = std::chrono::seconds(2);

}  // namespace

// Waits for a moment if the bridge has just been configured and does not know its peers' choice
// yet.
bool Runner::wantsSimulation(const Progress& progress) {
    if (!bridge_ || !settings_.bridge.enabled || settings_.sim_time == SimTime::Never) return false;
    if (settings_.sim_time == SimTime::Always) return true;
    progress("asking the ROS master for /use_sim_time");
    const auto until = std::chrono::steady_clock::now() + kBridgePatience;
    while (std::chrono::steady_clock::now() < until && !ending_) {
        requireNoStop();
        const BridgeStatus status = bridge_->status();
        if (status.simulated_time) return *status.simulated_time;
        if (!status.connected && !status.problem.empty()) return false;  // there is no master
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return false;
}

void Runner::simulate(bool simulated) {
    if (simulated) clock_->reset(settings_.max_clock_jump_ns);
    simulated_ = simulated;
    settings_.loop.clock = simulated ? clock_ : nullptr;
    settings_.loop.realtime.wanted = !simulated;
    if (!bridge_) return;
    for (const auto& injector : plan_->bridgeTable().inputs) injector->setQueueing(simulated);
    bridge_->setClock(settings_.loop.clock);
    if (!simulated) return;
    // Waits until the bridge follows the clock, so that a simulation started after the loop loses
    // no tick.
    const auto until = std::chrono::steady_clock::now() + kBridgePatience;
    while (!bridge_->status().follows_clock && std::chrono::steady_clock::now() < until && !ending_)
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
}

void Runner::noteClockJumps() {
    while (const std::optional<ClockJump> jump = clock_->takeJump()) {
        const double to = static_cast<double>(jump->to_ns) / 1e9;
        std::string message = fmt::format("the simulated clock begins at {:.9f} s", to);
        if (jump->from_ns) {
            message = fmt::format(
                "the simulated clock jumped from {:.9f} s to {:.9f} s: the loop "
                "continues from there with one cycle",
                static_cast<double>(*jump->from_ns) / 1e9, to);
        }
        tell({RunnerEvent::Kind::Clock,
              message,
              {},
              loop_.figures().iteration.load(std::memory_order_relaxed)});
    }
}

}  // namespace rtcf::executor
