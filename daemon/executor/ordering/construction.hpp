/// @file
/// The order in which to construct components, so that they lie in memory in the order of execution
/// and the processor prefetches the next one. Pure function; graph thread only.
#pragma once

#include <cstddef>
#include <vector>

#include "graph/difference.hpp"

namespace rtcf::executor {

/// The order of execution of components if there were no others, as indices into `wanted`;
/// components of a loop, and those behind it, come last.
/// @throws Error for an invalid `ignore`
std::vector<std::size_t> constructionOrder(const std::vector<const WantedComponent*>& wanted);

}  // namespace rtcf::executor
