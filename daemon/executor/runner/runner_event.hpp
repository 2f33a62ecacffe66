/// @file
/// An event of a runner without a request.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "view/runner_status.hpp"

namespace rtcf::executor {

struct RunnerEvent {
    enum class Kind {
        LoopEnded,
        Degraded,
        Ros,
        ComponentFailed,
        Overruns,
        Clock,
        ParametersChanged
    };
    Kind kind;
    std::string message;
    std::string component;
    std::uint64_t iteration = 0;
    /// ParametersChanged only: names of the parameters.
    std::vector<std::string> parameters = {};  // NOLINT(readability-redundant-member-init): gcc's
    NumberedState state = {};                  ///< state at the time of the event
};

/// Sends an event; logs errors.
using ReportEvent = std::function<void(const RunnerEvent& event)>;

}  // namespace rtcf::executor
