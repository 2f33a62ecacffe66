/// @file
/// Access from a component's hooks to the executor's ROS node. This header does not include ROS;
/// components include ros.hpp.
#pragma once

#include <stdexcept>

namespace rtcf {

/// There is no ROS master, or it has stopped answering. The text is one line that says what to do.
/// If a hook does not catch it, the executor rejects the change with this text.
class NoMaster : public std::runtime_error {
   public:
    using std::runtime_error::runtime_error;
};

/// Implemented by the executor's link to ROS; outlives all components.
class NodeGate {
   public:
    /// Waits until the node is up and its master answers, a few seconds at most. Not real-time.
    /// @throws NoMaster if the master does not answer
    /// @throws std::logic_error outside of a hook
    virtual void pass() = 0;

   protected:
    ~NodeGate() = default;
};

}  // namespace rtcf
