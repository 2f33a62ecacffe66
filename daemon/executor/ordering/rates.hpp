/// @file
/// Several rates in one loop: checks the divisors of the loop's frequency and assigns phases. Pure
/// functions; graph thread.
#pragma once

#include <string>

#include "graph/graph.hpp"

namespace rtcf::executor {

/// Checks that the rates of a graph are harmonic (of any two, one divides the other). Assigns each
/// slower component without a phase the cycle with the fewest components so far.
/// @param loading full name of the component to name first if two conflict; may be empty
/// @throws Error naming both components and the nearest rates that work
void assignPhases(const Graph& graph, const std::string& loading);

}  // namespace rtcf::executor
