/// @file
/// Registration of RTCF 2021's components.
#pragma once

#include <type_traits>

#include "rtcf/registration.hpp"
#include "rtt/TaskContext.hpp"

class RtcfExtension;

namespace rtcf::rtt_compat {

/// Makes a component whose constructor takes its name, as in OROCOS. Not real-time.
template <typename T>
Component* create(const char* name, ComponentContext* context) {
    static_assert(std::is_base_of_v<RTT::TaskContext, T>,
                  "ORO_CREATE_COMPONENT takes a class derived from RTT::TaskContext");
    // Lets the constructor log.
    const InHook hook(nullptr);
    auto* const component = detail::construct<T>(context, std::string(name));
    // Found by argument-dependent lookup; declared only in rtcf_extension.hpp.
    if constexpr (std::is_base_of_v<RtcfExtension, T>) bindRtcfExtension(*component, *component);
    return component;
}

}  // namespace rtcf::rtt_compat

/// @name Internals of the macros below: an identifier that is unique in its source file
/// @{
#define RTCF_COMPAT_JOIN_(a, b) RTCF_COMPAT_JOIN_EXPANDED_(a, b)
#define RTCF_COMPAT_JOIN_EXPANDED_(a, b) a##b
#define RTCF_COMPAT_REGISTER_(CLASS, NUMBER)                                                    \
    namespace {                                                                                 \
    ::rtcf::ComponentRecord RTCF_COMPAT_JOIN_(rtcf_record_, NUMBER){                            \
        ::rtcf::rtt_compat::baseName(#CLASS), "", &::rtcf::rtt_compat::create<CLASS>, nullptr}; \
    const ::rtcf::detail::Registration RTCF_COMPAT_JOIN_(rtcf_registration_, NUMBER){           \
        RTCF_COMPAT_JOIN_(rtcf_record_, NUMBER)};                                               \
    }
/// @}

namespace rtcf::rtt_compat {

/// Removes the namespaces of a class name, as a type's name is a ROS base name.
constexpr const char* baseName(const char* qualified) {
    const char* base = qualified;
    for (const char* at = qualified; *at != '\0'; ++at) {
        if (*at == ':' || *at == ' ') base = at + 1;
    }
    return base;
}

}  // namespace rtcf::rtt_compat

/// Registers a component class by its name, without the namespaces.
/// @{
#define ORO_CREATE_COMPONENT(CLASS) RTCF_COMPAT_REGISTER_(CLASS, __COUNTER__)
#define ORO_LIST_COMPONENT_TYPE(CLASS) RTCF_COMPAT_REGISTER_(CLASS, __COUNTER__)
/// @}

/// Empty: libraries with several components need nothing else. Works with or without a semicolon.
/// @{
#define ORO_CREATE_COMPONENT_LIBRARY()
#define ORO_CREATE_COMPONENT_TYPE()
/// @}
