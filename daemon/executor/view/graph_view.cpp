#include "view/graph_view.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "common/error.hpp"

namespace rtcf::executor {

namespace {

std::shared_ptr<const ComponentView> viewOf(const GraphNode& node) {
    const Instance& instance = *node.instance;
    auto result = std::make_shared<ComponentView>();
    result->instance = &instance;
    result->slot = instance.slot();
    result->statistics = instance.statistics();
    result->definition = instance.sharedDefinition();
    result->breaks = node.breaks;
    result->ports = instance.ports();
    result->full_name = instance.fullName();
    result->library = instance.library().path();
    result->doc = instance.record().doc;
    const auto& parameters = accessTo(instance.component()).parameters();
    result->parameters.reserve(parameters.size());
    for (std::size_t i = 0; i < parameters.size(); ++i) {
        const ParameterDeclaration& declaration = parameters[i]->declaration();
        const bool given = std::any_of(
            result->definition->parameters.begin(), result->definition->parameters.end(),
            [&](const auto& setting) { return setting.first == declaration.name; });
        result->parameters.push_back({declaration, instance.parameterValues()[i], given});
    }
    result->states.reserve(accessTo(instance.component()).states().size());
    for (const StateDeclaration& state : accessTo(instance.component()).states()) {
        result->states.push_back(
            {state.name, state.type, state.unit, state.doc, state.print(state.initial.data())});
    }
    result->fault = instance.faultText();
    return result;
}

// Adds the connections of a plan to a view that has its components.
class ConnectionsAdder {
   public:
    ConnectionsAdder(const Plan& plan, GraphView& view)
        : plan_(plan), view_(view), positions_(plan.wiring.order.size()) {
        for (std::size_t i = 0; i < positions_.size(); ++i)
            positions_[plan.wiring.order[i]] = static_cast<std::uint32_t>(i);
    }

    void addAll() {
        std::size_t endpoints = 0;
        for (const auto& component : view_.components) endpoints += component->ports->size();
        view_.endpoints.reserve(endpoints);  // connections refer to them
        view_.connections.reserve(plan_.wiring.connections.size());
        for (const auto& [name, connection] : plan_.wiring.connections) add(connection);
    }

   private:
    void add(const ConnectionPlan& plan) {
        const EndpointView* const begin = end();
        if (plan.writer) addWriter(*plan.writer);
        for (const Writer& writer : plan.others) addWriter(writer);
        const EndpointView* const readers = end();
        for (const Reader& reader : plan.readers) addReader(reader);
        view_.connections.push_back({view_.portOf(*begin).mapped_name,
                                     plan.type,
                                     {begin, readers},
                                     {readers, end()},
                                     plan.published,
                                     plan.subscribed});
    }
    const EndpointView* end() const { return view_.endpoints.data() + view_.endpoints.size(); }
    void addWriter(const Writer& writer) {
        const Instance& instance = *plan_.graph.nodes()[writer.node].instance;
        const std::size_t port = instance.placeOfOutput(writer.port);
        view_.endpoints.push_back(
            {positions_[writer.node], static_cast<std::uint32_t>(port), false});
    }
    void addReader(const Reader& reader) {
        const Component& component = plan_.graph.nodes()[reader.node].instance->component();
        const auto& inputs = accessTo(component).inputs();
        const auto port = std::find(inputs.begin(), inputs.end(), reader.input) - inputs.begin();
        view_.endpoints.push_back(
            {positions_[reader.node], static_cast<std::uint32_t>(port), reader.broken});
    }

    const Plan& plan_;
    GraphView& view_;
    std::vector<std::uint32_t> positions_;  // in the order of execution, by node
};

}  // namespace

ComponentDefinition ComponentView::present() const {
    ComponentDefinition result = *definition;
    result.breaks = breaks;
    return result;
}

const ComponentView& GraphView::get(const std::string& full_name) const {
    for (const auto& component : components) {
        if (component->full_name == full_name) return *component;
    }
    throw Error(ErrorKind::NotFound, fmt::format("no component {} in this runner", full_name));
}

const ConnectionView& GraphView::connectionOf(const MappedPort& port) const {
    return *std::lower_bound(connections.begin(), connections.end(), port.mapped_name,
                             [](const ConnectionView& connection, const std::string& name) {
                                 return connection.name < name;
                             });
}

bool GraphView::broken(std::size_t component, std::size_t port) const {
    for (const EndpointView& reader : connectionOf((*components[component]->ports)[port]).readers) {
        if (reader.component == component && reader.port == port) return reader.broken;
    }
    return false;
}

std::shared_ptr<const GraphView> makeGraphView(const Plan& plan, const GraphView& previous,
                                               const std::set<std::string>& changed) {
    auto result = std::make_shared<GraphView>();
    result->generation = plan.schedule.generation;
    std::map<const Instance*, std::shared_ptr<const ComponentView>> known;
    for (const auto& component : previous.components) known.emplace(component->instance, component);
    for (const std::size_t index : plan.wiring.order) {
        const GraphNode& node = plan.graph.nodes()[index];
        const auto found = known.find(node.instance.get());
        const bool same = found != known.end() &&
                          found->second->full_name == node.instance->fullName() &&
                          found->second->statistics == node.instance->statistics() &&
                          found->second->breaks == node.breaks &&
                          found->second->fault == node.instance->faultText() &&
                          changed.count(node.instance->fullName()) == 0;
        result->components.push_back(same ? found->second : viewOf(node));
    }
    ConnectionsAdder(plan, *result).addAll();
    for (const auto& [name, tap] : plan.serialized_taps) result->taps.push_back(tap);
    for (const auto& [name, tap] : plan.frame_taps) result->taps.push_back(tap);
    for (const auto& [name, injector] : plan.injectors) result->injectors.push_back(injector);
    return result;
}

}  // namespace rtcf::executor
