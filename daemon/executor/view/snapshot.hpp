/// @file
/// The graph view: an immutable copy of the graph that answers queries. The graph thread publishes
/// a new one after every change, so that a query never waits for a hook or for the loop.
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

/// A declared state of a component.
struct StateSnapshot {
    std::string name;
    std::string type;
    std::string unit;
    std::string doc;
    std::string initial;
};

/// One component. Its types are never unloaded and its statistics are shared, so it may outlive the
/// component.
struct ComponentSnapshot : ParameterSet {
    const Instance* instance;  ///< for comparison only
    std::shared_ptr<const ComponentFigures> figures;
    ComponentDefinition definition;  ///< with the present loop breaks
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
    std::vector<EndpointSnapshot> other_writers;  ///< further writers of a name without a reader
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

    /// @throws Refusal if there is no such component
    const ComponentSnapshot& get(const std::string& full_name) const;
};

/// Makes the graph view of `plan`. Unchanged components are shared with `previous`.
/// @param changed full names of components to copy again
std::shared_ptr<const GraphSnapshot> takeSnapshot(const Plan& plan, const GraphSnapshot& previous,
                                                  const std::set<std::string>& changed);

}  // namespace rtcf::executor
