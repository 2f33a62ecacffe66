/// @file
/// The way from a component's hooks to the executor's ROS node, without a word
/// of ROS: ros.hpp is what components include.
#pragma once

#include <stdexcept>

namespace rtcf {

/// There is no ROS master, or it stopped answering. Its text is one line that
/// says what to do; a hook that lets it pass is refused with it.
class NoMaster : public std::runtime_error {
   public:
    using std::runtime_error::runtime_error;
};

/// Implemented by the executor's link to ROS; outlives all components.
class NodeGate {
   public:
    /// Returns as soon as the node is up and its master answers; waits a few seconds at most.
    /// @throws NoMaster; std::logic_error outside of a hook
    virtual void pass() = 0;

   protected:
    ~NodeGate() = default;
};

}  // namespace rtcf
