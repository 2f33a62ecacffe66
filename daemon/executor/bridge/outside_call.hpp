/// @file
/// Requests of peers outside, such as callers of a ROS service. The executor passes them to its
/// supervisor, rtcfd, which treats them like requests of its own clients: rights, the search for
/// libraries and the desired state stay in one place.
#pragma once

#include <atomic>
#include <functional>
#include <string>

#include "graph/definition.hpp"

namespace rtcf::executor {

struct OutsideCall {
    enum class Kind { Load, Unload, Start, Stop };
    Kind kind = Kind::Start;
    ComponentDefinition component;  ///< Load only
    std::string name;               ///< Unload only: full name
};

struct OutsideAnswer {
    bool success = false;
    std::string message;  ///< one line
};

/// Sends the request to the supervisor and waits for its answer, for a bounded time. Returns soon
/// after `cancel` becomes true. Any thread but the real-time thread.
using AskSupervisor =
    std::function<OutsideAnswer(const OutsideCall& call, const std::atomic<bool>& cancel)>;

}  // namespace rtcf::executor
