/// @file
/// ROS for the hooks of a component: standard node handles with the component's namespace and
/// remaps.
///
///     bool configure() override {
///         client_ = rtcf::nodeHandle(this).serviceClient<std_srvs::Trigger>("calibrate");
///         return rtcf::privateNodeHandle(this).getParam("offset", offset_) || fail("no ~offset");
///     }
///
/// For configure(), start(), stop() and cleanup(). Never use a handle in update(): any call may
/// block. Callbacks run in a thread of the node. Build with `rtcf_add_components(… LINK
/// rtcf::ros)`.
#pragma once

#include <ros/node_handle.h>

#include <stdexcept>

#include "rtcf/component.hpp"

namespace rtcf {

namespace detail {

inline ros::NodeHandle openHandle(const Component& component, const std::string& name_space) {
    const ComponentContext& context = accessTo(component).context();
    if (context.gate == nullptr) {
        throw std::logic_error(
            "nodeHandle() is for configure(), start(), stop() and cleanup() in an executor with a "
            "ROS node");
    }
    context.gate->pass();
    return {name_space, ros::M_string(context.remaps.begin(), context.remaps.end())};
}

}  // namespace detail

/// True if the runner has a ROS node, so that nodeHandle() works in a hook. Real-time safe.
inline bool hasNode(const Component* component) noexcept {
    return accessTo(*component).context().gate != nullptr;
}

/// A node handle whose relative names are in the component's namespace. A call to the master by
/// this handle waits for one second at most; if a call gets no answer, the hook fails. Not
/// real-time safe.
/// @throws NoMaster if no master answers
/// @throws std::logic_error outside of a hook, or without a ROS node
inline ros::NodeHandle nodeHandle(const Component* component) {
    return detail::openHandle(*component, accessTo(*component).context().ns);
}

/// Like nodeHandle(), but relative names are below the component's full name, as `~name` is for a
/// node. Not real-time safe.
inline ros::NodeHandle privateNodeHandle(const Component* component) {
    return detail::openHandle(*component, component->fullName());
}

}  // namespace rtcf
