/// @file
/// What a peer outside, such as the caller of a ROS service, may ask for. The
/// executor decides nothing: its supervisor does what it does for its own
/// clients, so that rights, the search for libraries and the desired state are
/// in one place.
#pragma once

#include <atomic>
#include <functional>
#include <string>

#include "graph/definition.hpp"

namespace rtcf::executor {

struct OutsideCall {
    enum class Kind { Load, Unload, Start, Stop };
    Kind kind = Kind::Start;
    ComponentDefinition component;  ///< of Load
    std::string name;               ///< of Unload, full
};

struct OutsideAnswer {
    bool success = false;
    std::string message;  ///< one line
};

/// Asks the supervisor and waits for its answer, a bounded time. Any thread but
/// the real-time one; ends soon after `cancel` becomes true.
using AskSupervisor =
    std::function<OutsideAnswer(const OutsideCall& call, const std::atomic<bool>& cancel)>;

}  // namespace rtcf::executor
