/// @file
/// The graph view: an immutable copy of the graph that answers queries. The graph thread publishes
/// a new one after every change, so that a query never waits for a hook or for the loop.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "graph/definition.hpp"
#include "ordering/plan.hpp"

namespace rtcf::executor {

/// A port of a component. Types are never unloaded.
struct PortView {
    std::string name;
    bool output;
    std::string mapped_name;
    const TypeInfo* type;
    std::string unit;
};

/// A declared state of a component.
struct StateView {
    std::string name;
    std::string type;
    std::string unit;
    std::string doc;
    std::string initial;
};

/// One component. Its statistics are shared, and it may outlive the component.
struct ComponentView : ParameterSet {
    const Instance* instance;  ///< for comparison only
    std::shared_ptr<const ComponentStatistics> statistics;
    ComponentDefinition definition;  ///< with the present loop breaks
    std::string library;
    std::string doc;
    std::vector<PortView> ports;
    std::vector<StateView> states;
    std::string fault;
};

/// A port at one end of a connection.
struct EndpointView {
    std::string component;
    std::string port;
    bool broken;  ///< readers only: the connection is a loop break
};

/// The ports of one mapped name.
struct ConnectionView {
    std::string type;
    std::optional<EndpointView> writer;
    std::vector<EndpointView> other_writers;  ///< further writers of a name without a reader
    std::vector<EndpointView> readers;
    bool published;   ///< the bridge publishes its values
    bool subscribed;  ///< the bridge feeds it
};

/// The graph of one generation.
struct GraphView {
    std::uint64_t generation = 0;
    std::vector<std::shared_ptr<const ComponentView>> components;  ///< in order of execution
    std::map<std::string, ConnectionView> connections;
    std::vector<std::shared_ptr<Tap>> taps;
    std::vector<std::shared_ptr<const Injector>> injectors;

    /// @throws Error if there is no such component
    const ComponentView& get(const std::string& full_name) const;
};

/// Makes the graph view of `plan`. Unchanged components are shared with `previous`.
/// @param changed full names of components to copy again
std::shared_ptr<const GraphView> makeGraphView(const Plan& plan, const GraphView& previous,
                                               const std::set<std::string>& changed);

}  // namespace rtcf::executor
