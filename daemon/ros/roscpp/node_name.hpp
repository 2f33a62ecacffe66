/// @file
/// The name of a runner's node in ROS.
#pragma once

#include <string>

namespace rtcf::ros1 {

/// A node's name, in the two parts that roscpp needs: `/rtcfd/<host>/<runner>`, for a private
/// daemon `/rtcfd/<host>/<daemon>/<runner>`, or a configured one such as `/rt_runner`.
struct NodeName {
    std::string name_space;  ///< "/rtcfd/<host>"; empty = the root
    std::string base;        ///< "<runner>"

    std::string full() const { return name_space + "/" + base; }
};

/// The name of a runner's node on a host; characters that ROS does not allow become `_`.
/// @param daemon name of the daemon on the host; empty = the system daemon
NodeName nodeName(const std::string& host, const std::string& daemon, const std::string& runner);

/// The name of a runner's node with a configured namespace for its services, as from a launch file:
/// the namespace itself, so that ROS shows services, topics and loggers under one node.
/// @param name_space canonical; empty or "/" = none
/// @param otherwise name without a namespace
NodeName nodeNameOf(const std::string& name_space, const NodeName& otherwise);

/// The name of a runner's node on this host.
NodeName nodeName(const std::string& daemon, const std::string& runner);

}  // namespace rtcf::ros1
