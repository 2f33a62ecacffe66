/// @file
/// Start, stop and supervision of a loop: the state of the runner, a loop that ends by itself, the
/// present settings, and the published status. Owned by the runner; graph thread, in jobs.
#pragma once

#include <atomic>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "logging/log.hpp"
#include "loop/loop.hpp"
#include "loop/stall_monitor.hpp"
#include "runner/active_plan.hpp"
#include "runner/bridge_link.hpp"
#include "runner/fault_reports.hpp"
#include "runner/loop_boundary.hpp"
#include "runner/publication.hpp"
#include "runner/simulation.hpp"
#include "runner/spin_tuner.hpp"
#include "view/settings.hpp"

namespace rtcf::executor {

class LoopControl {
   public:
    /// @param runner   name of the runner, for messages
    /// @param settings present settings; applySettings() follows their changes
    /// @param ending   set by any thread when the runner ends
    /// All references outlive this object.
    LoopControl(std::string runner, RunnerSettings& settings, Loop& loop,
                const LoopBoundary& boundary, ActivePlan& plan, Publication& publication,
                BridgeLink& bridge, Log& log, ReportEvent report_event,
                const std::atomic<bool>& ending);

    /// Begins a job, which starts cycles only while no stop is requested.
    /// @param stops Loop::stops() when the job was posted
    void beginJob(std::uint64_t stops) noexcept { job_stops_ = stops; }
    RunnerState state() const noexcept { return publication_.state().state; }
    /// True while the loop follows a simulated clock.
    bool simulated() const noexcept { return simulation_.active(); }

    /// Starts all components and the loop, which does not run.
    /// @return missing prerequisites of real time, one line each
    const std::vector<std::string>& start(const Progress& progress);
    /// Stops the loop and all components.
    /// @throws Error if a component does not return
    void stop(const Progress& progress);
    /// Handles a loop that has ended by itself, which is possible at any time, even while a change
    /// waits for the next boundary.
    void noticeEnd();
    /// @throws Error if the loop runs
    void requireNoLoop();

    /// Starts all components and prepares the first step, see Loop::step().
    /// @param stamp_ns ROS time of the first cycle
    void beginStepping(const Progress& progress, std::int64_t stamp_ns = 0);
    /// Stops all components. After Loop::endStepping().
    void steppingEnded();

    /// Applies changed settings; LoopBoundary applies the period.
    void applySettings();
    /// Periodic work: a loop that ended by itself, clocks, reports.
    void tick();
    /// Reports faults of a component that has left the loop.
    void reportFaults(Instance& instance) { faults_.report(instance); }
    /// Ends the loop and stops all components, at the end of the runner.
    void finish() noexcept;

    /// Publishes the graph view of the plan, and the status.
    /// @param changed full names of components to copy again
    void publish(const std::set<std::string>& changed = {});
    void publishStatus();

   private:
    void requireNoStop() const;
    void startComponents(Pace pace, const Progress& progress);
    void reportOldMessages();
    void loopEnded();
    void noteLoopFault();
    RealtimeProblems lockAndStart();
    std::uint32_t mostOverruns() const noexcept;
    void reportOverruns(bool last);

    const std::string runner_;
    RunnerSettings& settings_;
    Loop& loop_;
    const LoopBoundary& boundary_;
    ActivePlan& plan_;
    Publication& publication_;
    BridgeLink& bridge_;
    Log& log_;
    const ReportEvent report_event_;
    StallMonitor stall_monitor_;
    Simulation simulation_;
    SpinTuner spin_tuner_;
    FaultReports faults_;
    std::uint64_t job_stops_ = 0;       // Loop::stops() when the present job was posted
    RealtimeProblems memory_problems_;  // result of lockMemory() at the last start
    std::vector<std::string> degraded_;
    std::string loop_fault_;
};

}  // namespace rtcf::executor
