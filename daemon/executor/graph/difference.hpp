/// @file
/// The changes that turn one graph into another. Pure functions; graph thread only.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "graph/definition.hpp"
#include "graph/graph.hpp"

namespace rtcf::executor {

/// Names of the ports of a type.
struct TypePorts {
    std::vector<std::string> inputs;
    std::vector<std::string> outputs;
};

/// A wanted component, and the library with its type.
struct WantedComponent {
    ComponentDefinition definition;
    std::string library;
    bool anew = false;  ///< load from the present file, even if the component already comes from it
    std::shared_ptr<const TypePorts> ports = nullptr;  ///< null = unknown
};

/// One difference between a component and the wanted one.
struct Difference {
    enum class Kind { Load, Unload, Replace, Breaks, Parameters };
    Kind kind;
    std::string component;                    ///< full name
    std::string detail;                       ///< one line
    const WantedComponent* wanted = nullptr;  ///< null for Unload
    /// Parameters only: new values
    std::vector<std::pair<std::string, ParameterValue>> parameters;
};

/// Compares a graph with the wanted one. Components to unload come first, the others in the order
/// of `wanted`. A parameter without a wanted value shall have its default.
/// @throws Error if a name is given twice
std::vector<Difference> compare(const Graph& graph, const std::vector<WantedComponent>& wanted);

}  // namespace rtcf::executor
