/// @file
/// The namespace of a runner's services and of its topic iteration_info. The node's own name is
/// unique. A configured namespace may belong to another node, for example of a second robot
/// launched from the same file; services registered there would replace those of the other node.
#pragma once

#include <chrono>
#include <string>

#include "ros/master/master_link.hpp"

namespace rtcf::ros1 {

/// Owned by RosInterface; watch thread.
class Claim {
   public:
    /// The namespace to use now: the configured one, unless a live node uses its names; otherwise
    /// the node's own. Queries the master unless it did so recently.
    /// @param wanted configured namespace; empty = the node's own
    const std::string& of(MasterLink& link, const std::string& wanted);

    /// The reason for not using the configured namespace, one line; empty = it is used.
    const std::string& problem() const { return problem_; }

   private:
    std::string wanted_;
    std::string used_;
    std::string problem_;
    std::chrono::steady_clock::time_point next_;  // time of the next query
};

}  // namespace rtcf::ros1
