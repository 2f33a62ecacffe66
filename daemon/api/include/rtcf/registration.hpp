/// @file
/// How a library offers its component types. `RTCF_COMPONENT(Pid, "…")`, once
/// per type in any source file, is all that is needed.
#pragma once

#include <cstdint>

#include "rtcf/version.hpp"

namespace rtcf {

class Component;
struct ComponentContext;

/// One component type of a library; static, in a list.
struct ComponentRecord {
    const char* type;  ///< e.g. "Pid"
    const char* doc;   ///< one line
    /// A new component, which the caller owns. `name` is the one that it will have; few components
    /// want to know it so early. `context` lets its constructor log; null where nobody listens.
    /// One call at a time.
    Component* (*create)(const char* name, ComponentContext* context);
    const ComponentRecord* next;
};

/// What a library's entry point gives. Its first two members never change.
struct PluginDescriptor {
    std::uint32_t abi_version;  ///< AbiProbe::fingerprint() of the headers it was built with
    std::uint32_t size;         ///< of this struct
    const char* version;        ///< release of the headers it was built with
    const ComponentRecord* components;
};

/// The entry point that the executor looks up in a library.
#define RTCF_ENTRY_POINT rtcf_plugin_descriptor
#define RTCF_ENTRY_POINT_NAME "rtcf_plugin_descriptor"

namespace detail {

/// The list of this library's types. Hidden, so that each library has its own.
__attribute__((visibility("hidden"))) inline const ComponentRecord* component_records = nullptr;

struct __attribute__((visibility("hidden"))) Registration {
    explicit Registration(ComponentRecord& record) {
        record.next = component_records;
        component_records = &record;
    }
};

/// What the component that is being constructed in this library has from the beginning.
__attribute__((visibility("hidden"))) inline ComponentContext* under_construction = nullptr;

/// Makes a component whose constructor may log.
template <typename T, typename... Arguments>
T* construct(ComponentContext* context, const Arguments&... arguments) {
    struct Guard {
        explicit Guard(ComponentContext* present) { under_construction = present; }
        ~Guard() { under_construction = nullptr; }
        Guard(const Guard&) = delete;
        Guard& operator=(const Guard&) = delete;
    };
    const Guard guard(context);
    return new T(arguments...);
}

}  // namespace detail

}  // namespace rtcf

/// Registers a component class, in the global namespace or by its qualified
/// name with RTCF_COMPONENT_NAMED.
#define RTCF_COMPONENT(CLASS, DOC) RTCF_COMPONENT_NAMED(CLASS, #CLASS, DOC, CLASS)

/// As RTCF_COMPONENT for a class in a namespace: `RTCF_COMPONENT_NAMED(arm::Pid, "Pid", "…",
/// ArmPid)`; TAG is any identifier unique in the source file.
#define RTCF_COMPONENT_NAMED(CLASS, NAME, DOC, TAG)                                \
    namespace {                                                                    \
    ::rtcf::ComponentRecord rtcf_record_##TAG{                                     \
        NAME, DOC,                                                                 \
        [](const char*, ::rtcf::ComponentContext* context) -> ::rtcf::Component* { \
            return ::rtcf::detail::construct<CLASS>(context);                      \
        },                                                                         \
        nullptr};                                                                  \
    const ::rtcf::detail::Registration rtcf_registration_##TAG{rtcf_record_##TAG}; \
    }
