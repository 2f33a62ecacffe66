/// @file
/// The name under which a runner's node appears in ROS.
#pragma once

#include <string>

namespace rtcf::ros1 {

/// `/rtcfd/<host>/<runner>`, of a private daemon `/rtcfd/<host>/<daemon>/<runner>`, or as the
/// runner's settings have it, `/rt_runner`; in the two parts that roscpp wants.
struct NodeName {
    std::string name_space;  ///< "/rtcfd/<host>"; empty: the root
    std::string base;        ///< "<runner>"

    std::string full() const { return name_space + "/" + base; }
};

/// The name of a runner's node on a host; what ROS does not allow in names becomes `_`.
/// @param daemon names the daemon among those of the host; empty: the system's
NodeName nodeName(const std::string& host, const std::string& daemon, const std::string& runner);

/// The name of a runner's node with a namespace for its services, as a launch file gives: the
/// namespace itself, so that ROS shows services, topics and loggers of one node.
/// @param name_space canonical; empty or "/": none
/// @param otherwise if there is none
NodeName nodeNameOf(const std::string& name_space, const NodeName& otherwise);

/// As above, on this host.
NodeName nodeName(const std::string& daemon, const std::string& runner);

}  // namespace rtcf::ros1
