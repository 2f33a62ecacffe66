/// @file
/// View of a runner for its bridge: graph, state, statistics, and every cycle. Implemented by the
/// runner. No function waits for a hook or for the loop.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "loop/cycle_statistics.hpp"
#include "loop/loop.hpp"
#include "view/graph_view.hpp"
#include "view/runner_status.hpp"

namespace rtcf::executor {

class RunnerView {
   public:
    /// @name Any thread
    /// @{
    virtual const std::string& name() const noexcept = 0;
    virtual std::shared_ptr<const GraphView> graph() const = 0;
    virtual RunnerStatus status() const = 0;
    virtual const Loop& loop() const noexcept = 0;
    virtual std::uint64_t logRecordsDropped() const = 0;
    virtual CycleStatistics& cycleStatistics() = 0;
    /// Cycles that were overwritten before nextCycle() took them.
    virtual std::uint64_t cyclesLost() const = 0;
    /// @}

    /// @name One thread
    /// @{
    /// Takes the next cycle. Cycles are lost unless it is called often.
    /// @return false if there is none yet
    virtual bool nextCycle(CycleRecord& cycle) = 0;
    /// Passes over the cycles so far.
    virtual void skipCycles() = 0;
    /// @}

   protected:
    ~RunnerView() = default;
};

}  // namespace rtcf::executor
