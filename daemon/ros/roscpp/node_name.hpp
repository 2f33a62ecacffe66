/// @file
/// The name under which a runner's node appears in ROS.
#pragma once

#include <string>

namespace rtcf::ros1 {

/// `/rtcfd/<host>/<runner>`, in the two parts that roscpp wants.
struct NodeName {
    std::string name_space;  ///< "/rtcfd/<host>"
    std::string base;        ///< "<runner>"

    std::string full() const { return name_space + "/" + base; }
};

/// The name of a runner's node on a host; what ROS does not allow in names becomes `_`.
NodeName nodeName(const std::string& host, const std::string& runner);

/// As above, on this host.
NodeName nodeName(const std::string& runner);

}  // namespace rtcf::ros1
