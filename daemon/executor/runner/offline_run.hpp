/// @file
/// Cycles without real time, in steps and replays. Owned by the runner; graph thread.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

#include "logging/log.hpp"
#include "loop/loop.hpp"
#include "runner/active_plan.hpp"
#include "runner/bridge_link.hpp"
#include "runner/change_outcome.hpp"
#include "runner/frame_keeper.hpp"
#include "runner/loop_control.hpp"
#include "runner/publication.hpp"
#include "runner/replay.hpp"
#include "runner/transactions.hpp"

namespace rtcf::executor {

class OfflineRun {
   public:
    /// @param runner name of the runner, for messages
    /// All references outlive this object.
    OfflineRun(std::string runner, Loop& loop, LoopControl& control, ActivePlan& plan,
               FrameKeeper& frames, const Publication& publication, BridgeLink& bridge,
               Transactions& transactions, Log& log);

    /// Runs cycles on a simulated clock, as fast as possible; then pauses.
    /// @param given_up set by any thread to pause at the next boundary; null = never
    /// @throws Error if the loop runs, and others
    ChangeOutcome step(std::uint64_t cycles, const Progress& progress,
                       const std::atomic<bool>* given_up);
    /// Runs a part of a replay. The first part recreates all components, and disconnects the bridge
    /// until the end of the replay.
    /// @throws Error if the loop runs, and others
    ReplayOutcome replay(const ReplayChunk& chunk, const Progress& progress);
    /// Ends steps or a replay, and stops all components. Does nothing if there are none.
    void end();

   private:
    ReplayOutcome beginReplay(const ReplayChunk& chunk, const Progress& progress);
    void connectBridge(bool connected);
    /// True if a component failed, or a stop was requested.
    bool ended() const;

    const std::string runner_;
    Loop& loop_;
    LoopControl& control_;
    ActivePlan& plan_;
    FrameKeeper& frames_;
    const Publication& publication_;
    BridgeLink& bridge_;
    Transactions& transactions_;
    Log& log_;
    std::unique_ptr<Replay> replay_;  // null = no replay
};

}  // namespace rtcf::executor
