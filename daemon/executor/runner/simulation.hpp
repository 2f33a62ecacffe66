/// @file
/// The simulated clock of a loop, which the bridge's peers set. Owned by LoopControl; graph thread.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

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
    /// The reason why no cycle runs while the clock is silent or stands still; empty = it moves.
    std::string silence() const;
    /// Reports the clock's jumps, steps back and silence; summarises many.
    /// @param last true = report the rest, as the loop has ended
    void report(const ReportEvent& report_event, bool last);

   private:
    void set(bool active, RunnerSettings& settings, const Plan& plan);
    void reportJump(const ClockJump& jump, const ReportEvent& report_event);
    void send(const std::string& message, const ReportEvent& report_event) const;

    const Loop& loop_;
    BridgeLink& bridge_;
    const std::atomic<bool>& ending_;
    std::shared_ptr<SimulatedClock> clock_ = std::make_shared<SimulatedClock>();
    bool active_ = false;
    // Times are CLOCK_MONOTONIC.
    std::int64_t begun_ns_ = 0;
    bool silence_reported_ = false;  // the present one
    std::uint64_t jumps_ = 0;        // since the last summary
    std::int64_t jumps_begun_ns_ = 0;
    ClockSteps steps_;  // not reported yet
    std::int64_t steps_reported_ns_ = 0;
};

}  // namespace rtcf::executor
