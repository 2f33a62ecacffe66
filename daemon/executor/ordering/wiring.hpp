/// @file
/// Wiring of a graph: connections by mapped name, topics, and the order of execution. Pure function
/// of a graph; graph thread only.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "graph/graph.hpp"
#include "names/name_pattern.hpp"

namespace rtcf::executor {

/// Selects the connections that become topics.
struct MappingFilter {
    NamePattern whitelist;
    NamePattern blacklist;
    bool matches(const std::string& name) const {
        return whitelist.matches(name) && !blacklist.matches(name);
    }
};

/// An input within a graph.
struct Reader {
    std::size_t node;  ///< index into Graph::nodes()
    InputPort* input;
    bool broken;  ///< true = its connection is a loop break
};

/// An output within a graph.
struct Writer {
    std::size_t node;
    std::size_t port;  ///< index into the component's outputs()
    OutputPort* output;
};

/// All ports of one mapped name.
struct ConnectionPlan {
    const TypeInfo* type = nullptr;
    std::optional<Writer> writer;
    std::vector<Writer> others;  ///< further writers of the name; then there are no readers
    std::vector<Reader> readers;
    bool published = false;   ///< outputs are published to ROS
    bool subscribed = false;  ///< inputs are subscribed from ROS
    bool written = false;     ///< Runner::writeInput() writes it, as there is no other writer
};

struct Wiring {
    std::map<std::string, ConnectionPlan> connections;  ///< by mapped name
    std::vector<std::size_t> order;                     ///< node indices in order of execution
};

/// The change that leads to a graph, for messages.
struct Origin {
    std::string loading;   ///< full name of the component to load; empty = another change
    bool applied = false;  ///< true = a whole graph is applied
};

/// Connects and orders a graph.
/// @throws Error if a name has two types, if a name with a reader has two writers, if a type
/// cannot be published, and for a loop
Wiring wire(const Graph& graph, const MappingFilter& filter, const Origin& origin);

/// Legal but possibly surprising effects of components on topics, one line each.
/// @param components full names
std::vector<std::string> remarks(const Graph& graph, const Wiring& wiring,
                                 const MappingFilter& filter,
                                 const std::set<std::string>& components);

}  // namespace rtcf::executor
