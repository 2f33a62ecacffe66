/// @file
/// Definition of one component of a graph: validated user input.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "graph/loop_breaks.hpp"
#include "names/names.hpp"
#include "rtcf/parameter.hpp"

namespace rtcf::executor {

/// A parameter value of a component that is being replaced.
struct InheritedParameter {
    std::string name;
    ParameterValue value;
    bool chosen = true;  ///< not the default, so its loss is reported
};

struct ComponentDefinition {
    std::string name;      ///< base name
    std::string ns = "/";  ///< canonical namespace
    std::string package;
    std::string type;
    Remaps remaps;
    std::vector<std::pair<std::string, ParameterValue>> parameters;  ///< load-time values
    /// Values of the replaced component; used if they are valid and `parameters` has no other
    /// value.
    std::vector<InheritedParameter> inherited;
    LoopBreaks breaks;
    std::uint32_t every = 1;  ///< runs in every n-th cycle
    /// Cycle modulo `every` in which it runs; unset = chosen to spread the load.
    std::optional<std::uint32_t> phase;
    bool optional = false;  ///< a fault takes the component out, and the loop goes on

    std::string fullName() const { return joinName(ns, name); }
};

}  // namespace rtcf::executor
