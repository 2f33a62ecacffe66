/// @file
/// What has to change for a graph to become another. Pure functions; graph
/// thread only.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "graph/definition.hpp"
#include "graph/graph.hpp"

namespace rtcf::executor {

/// A component as it shall be, and the library that has its type.
struct WantedComponent {
    ComponentDefinition definition;
    std::string library;
    bool anew = false;  ///< from the library as it is now, also if it is loaded from there already
};

/// One component that is not as it shall be.
struct Difference {
    enum class Kind { Load, Unload, Replace, Breaks, Parameters };
    Kind kind;
    std::string component;                                           ///< full name
    std::string detail;                                              ///< one line
    const WantedComponent* wanted = nullptr;                         ///< null for Unload
    std::vector<std::pair<std::string, ParameterValue>> parameters;  ///< of Parameters: new values
};

/// Compares a graph with what it shall be: first what leaves, then the rest in the order given.
/// A parameter that is not given shall have its default.
/// @throws Refusal if a name is given twice
std::vector<Difference> compare(const Graph& graph, const std::vector<WantedComponent>& wanted);

}  // namespace rtcf::executor
