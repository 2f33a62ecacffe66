/// @file
/// Several rates in one loop: which divisors of its frequency go together, and
/// in which of its n cycles a component runs. Pure functions; graph thread.
#pragma once

#include <string>

#include "graph/graph.hpp"

namespace rtcf::executor {

/// Checks that the rates of a graph are harmonic (each divides or is a multiple of each other), and
/// gives every slower component whose phase is not given the cycle with the fewest components so
/// far.
/// @param loading full name of the component to blame, of two that do not go together; may be empty
/// @throws Refusal naming both components and the nearest rates that work
void assignPhases(const Graph& graph, const std::string& loading);

}  // namespace rtcf::executor
