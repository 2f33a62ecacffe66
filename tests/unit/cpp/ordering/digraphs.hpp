/// @file
/// All directed graphs of a few nodes, self-loops included, one of each shape.
#pragma once

#include <cstdint>
#include <vector>

namespace rtcf::test {

/// A graph of up to 5 nodes: bit `5 * from + to` is set if there is an edge.
using Digraph = std::uint32_t;

constexpr unsigned kDigraphWidth = 5;

inline bool hasEdge(Digraph graph, unsigned from, unsigned to) {
    return (graph >> (kDigraphWidth * from + to) & 1U) != 0;
}

/// One graph of each isomorphism class of `nodes` (1 to 5) nodes, in ascending order.
std::vector<Digraph> digraphsUpToIsomorphism(unsigned nodes);

/// Whether the graph has no loop, decided by removing nodes without incoming edges.
bool isAcyclic(Digraph graph, unsigned nodes);

}  // namespace rtcf::test
