/// @file
/// All that defines one component of a graph: what a person wrote, checked.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "names/names.hpp"
#include "rtcf/parameter.hpp"

namespace rtcf::executor {

/// A value of a component that another one replaces.
struct InheritedParameter {
    std::string name;
    ParameterValue value;
    bool chosen = true;  ///< it is not the default: worth saying if it gets lost
};

struct ComponentDefinition {
    std::string name;      ///< base name
    std::string ns = "/";  ///< canonical namespace
    std::string package;
    std::string type;
    Remaps remaps;
    std::vector<std::pair<std::string, ParameterValue>> parameters;  ///< load-time values
    /// Values of the component it replaces, taken where they fit and `parameters` has no other.
    std::vector<InheritedParameter> inherited;
    bool first = false;  ///< all connections into it are loop breaks
    std::string ignore;  ///< regular expression of connections that are loop breaks for it
    std::set<std::string> breaks;  ///< inputs whose connection is a loop break
    std::uint32_t every = 1;       ///< runs each n-th cycle
    std::optional<std::uint32_t>
        phase;              ///< the cycle of those n it runs in; unset = chosen to spread load
    bool optional = false;  ///< a fault takes it out, and the loop goes on

    std::string fullName() const { return joinName(ns, name); }
};

}  // namespace rtcf::executor
