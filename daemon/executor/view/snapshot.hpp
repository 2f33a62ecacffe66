/// @file
/// What queries are answered from: an immutable picture of the graph that the
/// graph thread publishes after every change. A query never waits for a hook or
/// for the loop.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "graph/definition.hpp"
#include "ordering/plan.hpp"

namespace rtcf::executor {

struct PortSnapshot {
    std::string name;
    bool output;
    std::string mapped_name;
    const TypeInfo* type;
    std::string unit;
};

/// One component. What its pointers point to is never unloaded (types) or is
/// shared (figures), so a snapshot may outlive the component.
struct StateSnapshot {
    std::string name;
    std::string type;
    std::string unit;
    std::string doc;
    std::string initial;
};

struct ComponentSnapshot : ParameterSet {
    const Instance* instance;  ///< for comparison only
    std::shared_ptr<const ComponentFigures> figures;
    ComponentDefinition definition;  ///< with the breaks of now
    std::string library;
    std::string doc;
    std::vector<PortSnapshot> ports;
    std::vector<StateSnapshot> states;
    std::string fault;
};

struct EndpointSnapshot {
    std::string component;
    std::string port;
    bool broken;
};

struct ConnectionSnapshot {
    std::string type;
    std::optional<EndpointSnapshot> writer;
    std::vector<EndpointSnapshot> other_writers;  ///< of a name that no input reads
    std::vector<EndpointSnapshot> readers;
    bool published;
    bool subscribed;
};

struct GraphSnapshot {
    std::uint64_t generation = 0;
    std::vector<std::shared_ptr<const ComponentSnapshot>> components;  ///< in order of execution
    std::map<std::string, ConnectionSnapshot> connections;
    std::vector<std::shared_ptr<Tap>> taps;
    std::vector<std::shared_ptr<const Injector>> injectors;

    /// @throws Refusal if there is none of that name
    const ComponentSnapshot& get(const std::string& full_name) const;
};

/// A picture of `plan`; components that have not changed are shared with `previous`.
/// @param changed full names of components to picture anew
std::shared_ptr<const GraphSnapshot> takeSnapshot(const Plan& plan, const GraphSnapshot& previous,
                                                  const std::set<std::string>& changed);

}  // namespace rtcf::executor
