/// @file
/// The graph view: an immutable copy of the graph that answers queries. The graph thread publishes
/// a new one after every change, so that a query never waits for a hook or for the loop.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "graph/definition.hpp"
#include "ordering/plan.hpp"

namespace rtcf::executor {

/// A declared state of a component.
struct StateView {
    std::string name;
    std::string type;
    std::string unit;
    std::string doc;
    std::string initial;
};

/// One component. It may outlive the component, and shares its definition, ports and statistics.
struct ComponentView : ParameterSet {
    const Instance* instance;  ///< for comparison only
    std::uint32_t slot;        ///< in the flight recorder
    std::shared_ptr<const ComponentStatistics> statistics;
    std::shared_ptr<const ComponentDefinition> definition;  ///< with the first loop breaks
    LoopBreaks breaks;                                      ///< the present ones
    std::shared_ptr<const std::vector<MappedPort>> ports;
    std::string library;
    std::string doc;
    std::vector<StateView> states;
    std::string fault;

    /// The definition with the present loop breaks.
    ComponentDefinition present() const;
};

/// A port at one end of a connection.
struct EndpointView {
    std::uint32_t component;  ///< index into GraphView::components
    std::uint32_t port;       ///< index into ComponentView::ports
    bool broken;              ///< readers only: the connection is a loop break
};

/// Some endpoints of a graph view.
struct EndpointRange {
    const EndpointView* first;
    const EndpointView* last;  ///< behind the last one
    const EndpointView* begin() const noexcept { return first; }
    const EndpointView* end() const noexcept { return last; }
    bool empty() const noexcept { return first == last; }
};

/// The ports of one mapped name.
struct ConnectionView {
    std::string_view name;  ///< text of one of its ports
    const TypeInfo* type;
    /// Several only if there is no reader.
    EndpointRange writers;
    EndpointRange readers;
    bool published;   ///< the bridge publishes its values
    bool subscribed;  ///< the bridge feeds it

    bool connected() const noexcept { return !writers.empty() && !readers.empty(); }
};

/// The graph of one generation.
struct GraphView {
    GraphView() = default;
    GraphView(const GraphView&) = delete;  // its connections refer to its endpoints
    GraphView& operator=(const GraphView&) = delete;

    std::uint64_t generation = 0;
    std::vector<std::shared_ptr<const ComponentView>> components;  ///< in order of execution
    std::vector<ConnectionView> connections;                       ///< sorted by name
    std::vector<EndpointView> endpoints;                           ///< of all connections
    std::vector<std::shared_ptr<Tap>> taps;
    std::vector<std::shared_ptr<const Injector>> injectors;

    /// @throws Error if there is no such component
    const ComponentView& get(const std::string& full_name) const;
    const MappedPort& portOf(const EndpointView& endpoint) const noexcept {
        return (*components[endpoint.component]->ports)[endpoint.port];
    }
    /// The connection of a port. Each port has one.
    const ConnectionView& connectionOf(const MappedPort& port) const;
    /// True if the connection of a component's input is a loop break.
    bool broken(std::size_t component, std::size_t port) const;
};

/// Makes the graph view of `plan`. Unchanged components are shared with `previous`.
/// @param changed full names of components to copy again
std::shared_ptr<const GraphView> makeGraphView(const Plan& plan, const GraphView& previous,
                                               const std::set<std::string>& changed);

}  // namespace rtcf::executor
