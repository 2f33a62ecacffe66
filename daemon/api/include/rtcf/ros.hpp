/// @file
/// ROS for the hooks of a component: standard node handles that see names as
/// the component does, with its namespace and its remaps.
///
///     bool configure() override {
///         client_ = rtcf::nodeHandle(this).serviceClient<std_srvs::Trigger>("calibrate");
///         return rtcf::privateNodeHandle(this).getParam("offset", offset_) || fail("no ~offset");
///     }
///
/// For configure(), start(), stop() and cleanup(); never for update(), as all
/// that a handle does may block. Callbacks come from a thread of the node.
/// Build with `rtcf_add_components(… LINK rtcf::ros)`.
#pragma once

#include <ros/node_handle.h>

#include <stdexcept>

#include "rtcf/component.hpp"

namespace rtcf {

namespace detail {

inline ros::NodeHandle openHandle(const Component& component, const std::string& name_space) {
    const ComponentContext& context = component.context();
    if (context.gate == nullptr) {
        throw std::logic_error(
            "nodeHandle() is for configure(), start(), stop() and cleanup() in an executor with a "
            "ROS node");
    }
    context.gate->pass();
    return {name_space, ros::M_string(context.remaps.begin(), context.remaps.end())};
}

}  // namespace detail

/// A handle whose relative names are in the component's namespace. Each call to the master by
/// way of it takes a second at most; if one gets no answer the hook is refused.
/// @throws NoMaster if no master answers. Not real-time safe.
inline ros::NodeHandle nodeHandle(const Component* component) {
    return detail::openHandle(*component, component->context().ns);
}

/// As nodeHandle(), but relative names are below the component's full name: what `~name` is to
/// a node.
inline ros::NodeHandle privateNodeHandle(const Component* component) {
    return detail::openHandle(*component, component->fullName());
}

}  // namespace rtcf
