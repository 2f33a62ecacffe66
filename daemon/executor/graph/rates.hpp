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
/// @throws Refusal naming both components and the nearest rates that work
void assignPhases(const Graph& graph);

}  // namespace rtcf::executor
