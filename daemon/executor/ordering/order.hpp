/// @file
/// The order of execution: Kahn's algorithm (A. B. Kahn, "Topological sorting
/// of large networks", CACM 5(11), 1962) over the connections that are not loop
/// breaks, and what to say when there is none. Pure functions, not real-time.
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

/// What is to be ordered.
struct OrderProblem {
    std::vector<std::string> names;  ///< full names of the components
    std::vector<bool> first;         ///< goes before the others as soon as it is ready
    std::vector<Edge> edges;         ///< without loop breaks
};

/// An order, or why there is none.
struct OrderResult {
    std::vector<std::size_t> order;  ///< all components, if orderable
    std::vector<Edge> loop;          ///< else a loop: each edge ends where the next begins
    std::vector<std::vector<Edge>>
        cuts;  ///< for each edge of the loop, breaks with which there is an order
    bool orderable() const { return loop.empty(); }
};

/// Orders components. Among those that are ready, `first` ones go before the
/// others, then by name: a function of the graph alone. O((V + E) log V), and
/// for a cyclic graph times the number of breaks it takes and the loop's length.
OrderResult findOrder(const OrderProblem& problem);

}  // namespace rtcf::executor
