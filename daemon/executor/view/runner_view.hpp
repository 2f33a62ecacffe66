/// @file
/// View of a runner for its bridge: graph, state, statistics, and every cycle. Implemented by the
/// runner. No function waits for a hook or for the loop.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

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
    /// @}

    /// Takes the oldest cycle record. One thread, which must call it often: the loop drops records
    /// when the ring is full.
    /// @return false if there is none
    virtual bool popCycle(CycleRecord& record) = 0;

   protected:
    ~RunnerView() = default;
};

}  // namespace rtcf::executor
