/// @file
/// Takes and restores snapshots of a runner. Owned by the runner; graph thread.
#pragma once

#include <string>
#include <vector>

#include "loop/loop.hpp"
#include "runner/active_plan.hpp"
#include "runner/change_outcome.hpp"
#include "runner/loop_boundary.hpp"
#include "runner/loop_control.hpp"
#include "runner/offline_run.hpp"
#include "runner/transactions.hpp"
#include "snapshot/snapshot.hpp"
#include "view/settings.hpp"

namespace rtcf::executor {

/// A snapshot, and notes on omitted values, one line each.
struct SnapshotOutcome {
    Snapshot snapshot;
    std::vector<std::string> notes;
};

class Snapshots {
   public:
    /// @param runner   name of the runner
    /// @param settings present settings of the runner
    /// All references outlive this object.
    Snapshots(std::string runner, const RunnerSettings& settings, const Loop& loop,
              LoopBoundary& boundary, LoopControl& control, ActivePlan& plan,
              Transactions& transactions, OfflineRun& offline);

    /// Takes a snapshot at one boundary.
    SnapshotOutcome take();
    /// Restores a snapshot at one boundary: parameters, declared state, and the values of
    /// connections. If the loop does not run, it is then paused, as after a step.
    /// @throws Error or another exception; nothing has changed then
    ChangeOutcome restore(const Snapshot& snapshot, const Progress& progress);

   private:
    const std::string runner_;
    const RunnerSettings& settings_;
    const Loop& loop_;
    LoopBoundary& boundary_;
    LoopControl& control_;
    ActivePlan& plan_;
    Transactions& transactions_;
    OfflineRun& offline_;
};

}  // namespace rtcf::executor
