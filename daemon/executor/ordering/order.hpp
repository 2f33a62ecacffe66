/// @file
/// The order of execution: Kahn's algorithm (A. B. Kahn, "Topological sorting of large networks",
/// CACM 5(11), 1962) over the connections that are not loop breaks, and advice if there is no
/// order. Pure functions, not real-time.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace rtcf::executor {

/// A connection from an output to one input that the order has to respect.
struct Edge {
    std::size_t from;  ///< index of the writing component
    std::size_t to;    ///< index of the reading component
    std::string from_port;
    std::string to_port;
};

/// Input of findOrder().
struct OrderProblem {
    std::vector<std::string> names;  ///< full names of the components
    std::vector<bool> first;         ///< runs before the others as soon as it is ready
    std::vector<Edge> edges;         ///< without loop breaks
};

/// An order, or a loop that prevents one.
struct OrderResult {
    std::vector<std::size_t> order;  ///< all components, if orderable
    std::vector<Edge> loop;          ///< else a loop: each edge ends where the next begins
    /// For each edge of the loop, a set of breaks that includes it and makes an order possible.
    std::vector<std::vector<Edge>> cuts;
    bool orderable() const { return loop.empty(); }
};

/// Orders components as far as there are no loops, as findOrder(). O((V + E) log V).
std::vector<std::size_t> orderUpToLoops(const OrderProblem& problem);

/// Orders components. Among those that are ready, `first` ones run before the others, then the
/// order is by name, so it is a function of the graph alone. O((V + E) log V); for a graph with
/// loops, times the number of breaks needed and the length of the loop.
OrderResult findOrder(const OrderProblem& problem);

}  // namespace rtcf::executor
