/// @file
/// Changes of values at one cycle boundary: parameters, declared state, and inputs without a
/// writer. Owned by the runner; graph thread. If a function throws Error, it has changed nothing.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "logging/log.hpp"
#include "loop/loop.hpp"
#include "runner/active_plan.hpp"
#include "runner/bridge_link.hpp"
#include "runner/change_outcome.hpp"
#include "runner/loop_boundary.hpp"
#include "runner/loop_control.hpp"
#include "runner/publication.hpp"
#include "runner/transactions.hpp"

namespace rtcf::executor {

/// An input without a writer.
struct WritableInput {
    std::string topic;  ///< mapped name
    const TypeInfo* type;
};

class ValueChanges {
   public:
    /// @param runner name of the runner, for messages
    /// All references outlive this object.
    ValueChanges(std::string runner, const Loop& loop, LoopBoundary& boundary, LoopControl& control,
                 ActivePlan& plan, const Publication& publication, BridgeLink& bridge,
                 Transactions& transactions, Log& log);

    ChangeOutcome setParameters(const std::string& name,
                                const std::vector<std::pair<std::string, ParameterValue>>& batch);
    /// Resets a component's declared state to its initial values.
    ChangeOutcome reset(const std::string& name);
    /// Sets declared state of a component (numbers and bools). Only while the loop does not run.
    ChangeOutcome setStates(const std::string& name,
                            const std::vector<std::pair<std::string, ParameterValue>>& batch);
    /// The input, if it can be written.
    /// @throws Error also if a component or ROS writes it
    WritableInput writableInput(const std::string& name, const std::string& port) const;
    /// Writes a value to such an input.
    /// @param message serialised message of the input's ROS type
    ChangeOutcome writeInput(const std::string& name, const std::string& port,
                             const std::string& message);

   private:
    const std::string runner_;
    const Loop& loop_;
    LoopBoundary& boundary_;
    LoopControl& control_;
    ActivePlan& plan_;
    const Publication& publication_;
    BridgeLink& bridge_;
    Transactions& transactions_;
    Log& log_;
};

}  // namespace rtcf::executor
