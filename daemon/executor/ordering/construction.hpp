/// @file
/// The order in which to construct components, so that they lie in memory in the order of execution
/// and the processor prefetches the next one. Pure function; graph thread only.
#pragma once

#include <cstddef>
#include <vector>

#include "graph/definition.hpp"
#include "graph/instance.hpp"

namespace rtcf::executor {

/// A component to construct.
struct Blueprint {
    const ComponentDefinition* definition = nullptr;
    const std::vector<MappedPort>* ports = nullptr;  ///< of any component of its type
};

/// The order of execution of components if there were no others, as indices into `blueprints`;
/// components of a loop, and those behind it, come last.
/// @throws Error for an invalid `ignore`
std::vector<std::size_t> constructionOrder(const std::vector<Blueprint>& blueprints);

}  // namespace rtcf::executor
