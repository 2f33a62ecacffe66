/// @file
/// Result of a change of a runner.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "graph/difference.hpp"
#include "ordering/plan.hpp"

namespace rtcf::executor {

/// Reports the progress of a change, one line.
using Progress = std::function<void(const std::string&)>;

struct ChangeOutcome {
    std::uint64_t generation = 0;
    std::vector<std::string> order;       ///< full names, in order of execution
    std::string component;                ///< full name of the changed component; may be empty
    std::vector<std::string> notes;       ///< one line each
    std::vector<std::string> degraded;    ///< start() only: missing prerequisites of real time
    std::vector<Difference> differences;  ///< apply() only
    std::uint64_t cycles = 0;             ///< step() only: cycles run
    /// replace() only: parameter values kept from the old component.
    std::vector<std::pair<std::string, ParameterValue>> kept;
};

/// The outcome of a change after which the loop executes `plan`.
/// @param component full name of the changed component; may be empty
ChangeOutcome outcomeWith(const Plan& plan, std::string component = {});

}  // namespace rtcf::executor
