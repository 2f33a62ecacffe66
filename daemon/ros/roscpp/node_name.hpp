/// @file
/// The name under which a runner's node appears in ROS.
#pragma once

#include <string>

namespace rtcf::ros1 {

/// `/rtcfd/<host>/<runner>`, or of a private daemon `/rtcfd/<host>/<daemon>/<runner>`, in the two
/// parts that roscpp wants.
struct NodeName {
    std::string name_space;  ///< "/rtcfd/<host>", or with a daemon's name
    std::string base;        ///< "<runner>"

    std::string full() const { return name_space + "/" + base; }
};

/// The name of a runner's node on a host; what ROS does not allow in names becomes `_`.
/// @param daemon names the daemon among those of the host; empty: the system's
NodeName nodeName(const std::string& host, const std::string& daemon, const std::string& runner);

/// As above, on this host.
NodeName nodeName(const std::string& daemon, const std::string& runner);

}  // namespace rtcf::ros1
