/// @file
/// From names to connections and an order: who writes what, who reads it, what
/// leaves the loop for ROS. Pure function of a graph; graph thread only.
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

/// Which connections become topics.
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
    InputBase* input;
    bool broken;  ///< its connection is a loop break
};

/// An output within a graph.
struct Writer {
    std::size_t node;
    std::size_t port;  ///< index into the component's outputs()
    OutputBase* output;
};

/// All ports of one mapped name.
struct ConnectionPlan {
    const TypeInfo* type = nullptr;
    std::optional<Writer> writer;
    std::vector<Writer> others;  ///< write the name too, which then no input reads
    std::vector<Reader> readers;
    bool published = false;   ///< to ROS
    bool subscribed = false;  ///< from ROS
    bool written = false;     ///< by Runner::writeInput(), as nobody else feeds it
};

struct Wiring {
    std::map<std::string, ConnectionPlan> connections;  ///< by mapped name
    std::vector<std::size_t> order;                     ///< node indices in order of execution
};

/// Connects and orders a graph. @param loading full name of a component that is not part of the
/// running graph yet, for the advice how to break a loop; may be empty
/// @throws Refusal for two types of one name, for two writers of one that is read, for a type that
/// cannot be published, and for a loop
Wiring wire(const Graph& graph, const MappingFilter& filter, const std::string& loading);

/// What the ports of some components, by their full names, make of the topics that is not refused
/// and may surprise: one line each.
std::vector<std::string> remarks(const Graph& graph, const Wiring& wiring,
                                 const MappingFilter& filter,
                                 const std::set<std::string>& components);

}  // namespace rtcf::executor
