/// @file
/// The simulated clock of a loop, which the bridge's peers set. Owned by LoopControl; graph thread.
#pragma once

#include <atomic>
#include <functional>
#include <memory>

#include "loop/loop.hpp"
#include "loop/simulated_clock.hpp"
#include "ordering/plan.hpp"
#include "runner/bridge_link.hpp"
#include "runner/change_outcome.hpp"
#include "runner/runner_event.hpp"
#include "view/settings.hpp"

namespace rtcf::executor {

class Simulation {
   public:
    /// @param ending set by any thread when the runner ends; ends all waiting
    Simulation(const Loop& loop, BridgeLink& bridge, const std::atomic<bool>& ending)
        : loop_(loop), bridge_(bridge), ending_(ending) {}

    /// True if the loop is to follow the clock. Waits for a moment if the bridge has just been
    /// configured and does not know its peers' choice yet.
    /// @param require_go throws if the start has become invalid
    bool wanted(const RunnerSettings& settings, const Progress& progress,
                const std::function<void()>& require_go) const;
    /// Switches the loop's settings and the inputs of the plan to the clock, and waits until the
    /// bridge follows it, so that a simulation started after the loop loses no tick.
    void begin(RunnerSettings& settings, const Plan& plan);
    /// Switches them back.
    void end(RunnerSettings& settings, const Plan& plan);
    /// True between begin() and end().
    bool active() const noexcept { return active_; }
    /// Reports jumps of the clock.
    void reportJumps(const ReportEvent& report_event);

   private:
    void set(bool active, RunnerSettings& settings, const Plan& plan);

    const Loop& loop_;
    BridgeLink& bridge_;
    const std::atomic<bool>& ending_;
    std::shared_ptr<SimulatedClock> clock_ = std::make_shared<SimulatedClock>();
    bool active_ = false;
};

}  // namespace rtcf::executor
