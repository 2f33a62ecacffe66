#include "view/graph_view.hpp"

#include <fmt/format.h>

#include "common/error.hpp"

namespace rtcf::executor {

namespace {

std::shared_ptr<const ComponentView> viewOf(const GraphNode& node) {
    const Instance& instance = *node.instance;
    auto result = std::make_shared<ComponentView>();
    result->instance = &instance;
    result->statistics = instance.statistics();
    result->definition = instance.definition();
    result->definition.breaks = node.breaks;
    result->full_name = instance.fullName();
    result->library = instance.library().path();
    result->doc = instance.record().doc;
    const auto& inputs = accessTo(instance.component()).inputs();
    const auto& outputs = accessTo(instance.component()).outputs();
    result->ports.reserve(inputs.size() + outputs.size());
    for (std::size_t i = 0; i < inputs.size(); ++i) {
        result->ports.push_back(
            {inputs[i]->name(), false, instance.inputNames()[i], &inputs[i]->type(), {}});
    }
    for (std::size_t i = 0; i < outputs.size(); ++i) {
        result->ports.push_back({outputs[i]->name(), true, instance.outputNames()[i],
                                 &outputs[i]->type(), outputs[i]->unit()});
    }
    const auto& parameters = accessTo(instance.component()).parameters();
    result->parameters.reserve(parameters.size());
    for (std::size_t i = 0; i < parameters.size(); ++i) {
        result->parameters.push_back({parameters[i]->declaration(), instance.parameterValues()[i]});
    }
    result->states.reserve(accessTo(instance.component()).states().size());
    for (const StateDeclaration& state : accessTo(instance.component()).states()) {
        result->states.push_back(
            {state.name, state.type, state.unit, state.doc, state.print(state.initial.data())});
    }
    result->fault = instance.faultText();
    return result;
}

ConnectionView viewOf(const Graph& graph, const ConnectionPlan& plan) {
    const auto component = [&](std::size_t node) {
        return graph.nodes()[node].instance->fullName();
    };
    ConnectionView result{plan.type->name, {}, {}, {}, plan.published, plan.subscribed};
    if (plan.writer)
        result.writer = {component(plan.writer->node), plan.writer->output->name(), false};
    for (const Writer& writer : plan.others)
        result.other_writers.push_back({component(writer.node), writer.output->name(), false});
    result.readers.reserve(plan.readers.size());
    for (const Reader& reader : plan.readers) {
        result.readers.push_back({component(reader.node), reader.input->name(), reader.broken});
    }
    return result;
}

}  // namespace

const ComponentView& GraphView::get(const std::string& full_name) const {
    for (const auto& component : components) {
        if (component->full_name == full_name) return *component;
    }
    throw Error(ErrorKind::NotFound, fmt::format("no component {} in this runner", full_name));
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
                          found->second->definition.breaks == node.breaks &&
                          found->second->fault == node.instance->faultText() &&
                          changed.count(node.instance->fullName()) == 0;
        result->components.push_back(same ? found->second : viewOf(node));
    }
    for (const auto& [name, connection] : plan.wiring.connections) {
        result->connections.emplace(name, viewOf(plan.graph, connection));
    }
    for (const auto& [name, tap] : plan.serialized_taps) result->taps.push_back(tap);
    for (const auto& [name, tap] : plan.frame_taps) result->taps.push_back(tap);
    for (const auto& [name, injector] : plan.injectors) result->injectors.push_back(injector);
    return result;
}

}  // namespace rtcf::executor
