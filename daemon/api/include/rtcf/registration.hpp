/// @file
/// Registration of a library's component types. `RTCF_COMPONENT(Pid, "…")`, once per type in any
/// source file, is all that a component needs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

#include "rtcf/component_memory.hpp"
#include "rtcf/version.hpp"

namespace rtcf {

class Component;
struct ComponentContext;

/// One component type of a library: an element of a static list.
struct ComponentRecord {
    const char* type;  ///< e.g. "Pid"
    const char* doc;   ///< description, one line
    /// Makes a component, which the caller owns. Not real-time; one call at a time.
    /// @param name the component's name, for the few constructors that need it
    /// @param context lets the constructor log; null = no log
    Component* (*create)(const char* name, ComponentContext* context);
    const ComponentRecord* next;
};

/// Result of a library's entry point. The first two members never change.
struct PluginDescriptor {
    /// AbiProbe::fingerprint() of the headers that the library was built with
    std::uint32_t abi_version;
    std::uint32_t size;   ///< size of this struct, bytes
    const char* version;  ///< release of these headers
    const ComponentRecord* components;
};

/// The entry point that the executor looks up in a library.
#define RTCF_ENTRY_POINT rtcf_plugin_descriptor
#define RTCF_ENTRY_POINT_NAME "rtcf_plugin_descriptor"

namespace detail {

/// The list of this library's types. Hidden, because each library needs its own.
__attribute__((visibility("hidden"))) inline const ComponentRecord* component_records = nullptr;

struct __attribute__((visibility("hidden"))) Registration {
    explicit Registration(ComponentRecord& record) {
        record.next = component_records;
        component_records = &record;
    }
};

/// Context of the component that is being constructed in this library.
__attribute__((visibility("hidden"))) inline ComponentContext* under_construction = nullptr;

/// Notes the size of the component. @return the context's memory for components; null = the heap
ComponentMemory* memoryFor(ComponentContext* context, std::size_t size) noexcept;

/// Constructs a component whose constructor may log.
template <typename T, typename... Arguments>
T* construct(ComponentContext* context, const Arguments&... arguments) {
    struct Guard {
        explicit Guard(ComponentContext* present)
            : before(std::exchange(under_construction, present)) {}
        ~Guard() { under_construction = before; }
        Guard(const Guard&) = delete;
        Guard& operator=(const Guard&) = delete;
        ComponentContext* before;
    };
    const Guard guard(context);
    const ConstructionScope scope(memoryFor(context, sizeof(T)));
    return new T(arguments...);
}

}  // namespace detail

}  // namespace rtcf

/// Registers a component class of the global namespace under its own name. DOC is a description of
/// one line. For a class in a namespace, use RTCF_COMPONENT_NAMED.
#define RTCF_COMPONENT(CLASS, DOC) RTCF_COMPONENT_NAMED(CLASS, #CLASS, DOC, CLASS)

/// Registers a component class under another name, e.g. one in a namespace:
/// `RTCF_COMPONENT_NAMED(arm::Pid, "Pid", "…", ArmPid)`. TAG is any identifier that is unique in
/// the source file.
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
