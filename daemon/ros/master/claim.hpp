/// @file
/// The namespace of a runner's services and of its topic iteration_info. The node's own name is
/// nobody else's; one that was asked for may be another node's, as of a second robot that was
/// launched from the same file: a service registered there would take the other's place.
#pragma once

#include <chrono>
#include <string>

#include "ros/master/master_link.hpp"

namespace rtcf::ros1 {

/// Owned by the subjects; watch thread.
class Claim {
   public:
    /// The namespace to use now: the one that was asked for, unless another node that lives has
    /// its names; then, and where none was asked for, the node's own. Asks the master if it was
    /// not asked of late.
    /// @param wanted empty: the node's own
    const std::string& of(MasterLink& link, const std::string& wanted);

    /// Why it is not the one that was asked for, one line; empty if it is.
    const std::string& problem() const { return problem_; }

   private:
    std::string wanted_;
    std::string used_;
    std::string problem_;
    std::chrono::steady_clock::time_point next_;  // when the master is asked again
};

}  // namespace rtcf::ros1
