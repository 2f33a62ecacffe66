#include "messages/to_wire.hpp"

#include <fmt/format.h>

#include "common/error.hpp"
#include "messages/parameter_value.hpp"
#include "messages/snapshot_file.hpp"

namespace rtcf::executor {

namespace pb = ::rtcf::v1;

namespace {

pb::ParameterInfo parameterTo(const ParameterDeclaration& declaration,
                              const ParameterValue& value) {
    pb::ParameterInfo info;
    info.set_name(declaration.name);
    *info.mutable_value() = parameterValueTo(value);
    *info.mutable_default_value() = parameterValueTo(declaration.default_value);
    if (declaration.minimum) info.set_minimum(*declaration.minimum);
    if (declaration.maximum) info.set_maximum(*declaration.maximum);
    info.set_unit(declaration.unit);
    info.set_doc(declaration.doc);
    for (const Choice& choice : declaration.choices) info.add_choices(choice.name);
    info.set_type(declaration.type);
    info.set_vector(declaration.vectorName());
    info.set_fixed(declaration.fixed);
    return info;
}

void setPortType(pb::PortInfo& info, const std::string& name, bool output, const TypeInfo& type,
                 const PortTexts& texts) {
    info.set_name(name);
    info.set_direction(output ? pb::DIRECTION_OUTPUT : pb::DIRECTION_INPUT);
    info.set_type(type.name);
    info.set_md5(type.md5);
    info.set_unit(texts.unit);
    info.set_doc(texts.doc);
}

pb::Difference::Kind differenceKindTo(Difference::Kind kind) {
    switch (kind) {
        case Difference::Kind::Load:
            return pb::Difference::KIND_LOAD;
        case Difference::Kind::Unload:
            return pb::Difference::KIND_UNLOAD;
        case Difference::Kind::Replace:
            return pb::Difference::KIND_REPLACE;
        case Difference::Kind::Breaks:
            return pb::Difference::KIND_BREAKS;
        case Difference::Kind::Parameters:
            break;
    }
    return pb::Difference::KIND_PARAMETERS;
}

}  // namespace

pb::ComponentSpec specTo(const ComponentDefinition& definition) {
    pb::ComponentSpec spec;
    spec.set_name(definition.name);
    spec.set_ns(definition.ns);
    spec.set_package(definition.package);
    spec.set_type(definition.type);
    for (const auto& [from, to] : definition.remaps) {
        auto* remap = spec.add_remaps();
        remap->set_source(from);
        remap->set_target(to);
    }
    for (const auto& [name, value] : definition.parameters) {
        auto* parameter = spec.add_parameters();
        parameter->set_name(name);
        *parameter->mutable_value() = parameterValueTo(value);
    }
    spec.set_first(definition.breaks.first);
    spec.set_ignore(definition.breaks.ignore.text());
    for (const std::string& port : definition.breaks.ports) spec.add_breaks(port);
    spec.set_every(definition.every);
    if (definition.phase) spec.set_phase(*definition.phase);
    spec.set_optional(definition.optional);
    return spec;
}

pb::RunnerState stateTo(RunnerState state) {
    switch (state) {
        case RunnerState::Running:
            return pb::RUNNER_STATE_RUNNING;
        case RunnerState::Faulted:
            return pb::RUNNER_STATE_FAULTED;
        case RunnerState::Stuck:
            return pb::RUNNER_STATE_STUCK;
        case RunnerState::Stepping:
            return pb::RUNNER_STATE_STEPPING;
        case RunnerState::Stopped:
            break;
    }
    return pb::RUNNER_STATE_STOPPED;
}

v1::ServiceCall callTo(std::uint64_t number, const OutsideCall& call) {
    v1::ServiceCall message;
    message.set_call(number);
    switch (call.kind) {
        case OutsideCall::Kind::Load:
            *message.mutable_load() = specTo(call.component);
            break;
        case OutsideCall::Kind::Unload:
            message.set_unload(call.name);
            break;
        case OutsideCall::Kind::Start:
            message.mutable_start();
            break;
        case OutsideCall::Kind::Stop:
            message.mutable_stop();
            break;
    }
    return message;
}

pb::ReplayResponse replayTo(ReplayOutcome outcome) {
    const auto describe = [](const RecordedTopic& topic, pb::RecordedTopic& message) {
        message.set_topic(topic.topic);
        message.set_type(topic.type);
        message.set_md5(topic.md5);
        message.set_definition(topic.definition);
    };
    pb::ReplayResponse response;
    response.set_cycles(outcome.cycles);
    response.set_consumed(static_cast<std::uint32_t>(outcome.consumed));
    response.set_more(outcome.more);
    for (RecordedMessage& output : outcome.outputs) {
        pb::RecordedMessage& message = *response.add_outputs();
        message.set_topic(output.topic);
        message.set_time_ns(output.time_ns);
        message.set_data(std::move(output.bytes));
    }
    for (const RecordedTopic& topic : outcome.inputs) describe(topic, *response.add_inputs());
    for (const RecordedTopic& topic : outcome.written) describe(topic, *response.add_written());
    return response;
}

void setState(v1::Response& response, const NumberedState& state) {
    response.set_state(stateTo(state.state));
    response.set_state_number(state.number);
}

pb::ChangeResult outcomeTo(const ChangeOutcome& outcome) {
    pb::ChangeResult result;
    result.set_generation(outcome.generation);
    for (const std::string& name : outcome.order) result.add_order(name);
    result.set_component(outcome.component);
    for (const std::string& line : outcome.notes) result.add_notes(line);
    for (const std::string& line : outcome.degraded) result.add_degraded(line);
    for (const Difference& difference : outcome.differences) {
        pb::Difference& message = *result.add_differences();
        message.set_kind(differenceKindTo(difference.kind));
        message.set_component(difference.component);
        message.set_detail(difference.detail);
    }
    result.set_cycles(outcome.cycles);
    for (const auto& [name, value] : outcome.kept) {
        pb::ParameterSetting& setting = *result.add_kept();
        setting.set_name(name);
        *setting.mutable_value() = parameterValueTo(value);
    }
    return result;
}

v1::Snapshot snapshotTo(const SnapshotOutcome& outcome) {
    constexpr std::size_t kLargest = 15 * 1024 * 1024;
    v1::Snapshot message;
    message.set_snapshot(snapshotToFile(outcome.snapshot));
    if (message.snapshot().size() > kLargest) {
        throw Error(ErrorKind::ResourceExhausted,
                    fmt::format("the snapshot of {} has {} bytes, at most {}: declare less state, "
                                "or divide the graph among runners",
                                outcome.snapshot.runner, message.snapshot().size(), kLargest));
    }
    message.set_iteration(outcome.snapshot.clock.iteration);
    for (const std::string& line : outcome.notes) message.add_notes(line);
    return message;
}

v1::InputType inputTypeTo(const WritableInput& input) {
    v1::InputType type;
    type.set_ros_type(input.type->ros_type);
    type.set_ros_definition(input.type->ros_definition);
    return type;
}

v1::LogRecord logTo(const LogEntry& entry) {
    v1::LogRecord record;
    record.set_level(static_cast<v1::LogRecord::Level>(entry.level));
    record.set_time_ns(entry.time_ns);
    record.set_iteration(entry.iteration);
    record.set_component(entry.component);
    record.set_message(entry.message);
    record.set_file(entry.file);
    record.set_line(entry.line);
    record.set_function(entry.function);
    record.set_realtime(entry.realtime);
    return record;
}

v1::Event eventTo(const RunnerEvent& event) {
    v1::Event message;
    switch (event.kind) {
        case RunnerEvent::Kind::LoopEnded:
            message.set_kind(v1::Event::KIND_LOOP_ENDED);
            break;
        case RunnerEvent::Kind::Degraded:
            message.set_kind(v1::Event::KIND_DEGRADED);
            break;
        case RunnerEvent::Kind::ComponentFailed:
            message.set_kind(v1::Event::KIND_COMPONENT_FAILED);
            break;
        case RunnerEvent::Kind::Overruns:
            message.set_kind(v1::Event::KIND_OVERRUNS);
            break;
        case RunnerEvent::Kind::Clock:
            message.set_kind(v1::Event::KIND_CLOCK);
            break;
        case RunnerEvent::Kind::ParametersChanged:  // has a message of its own
        case RunnerEvent::Kind::Ros:
            message.set_kind(v1::Event::KIND_ROS);
            break;
    }
    message.set_message(event.message);
    message.set_component(event.component);
    message.set_iteration(event.iteration);
    return message;
}

pb::ComponentInfo componentTo(const GraphView& graph, std::size_t position, RunnerState state) {
    const ComponentView& component = *graph.components[position];
    pb::ComponentInfo info;
    info.set_full_name(component.full_name);
    *info.mutable_spec() = specTo(component.present());
    info.set_position(static_cast<std::uint32_t>(position));
    info.set_library(component.library);
    info.set_doc(component.doc);
    info.set_fault(component.fault);
    info.set_faults(component.statistics->faults.count.value());
    const pb::ComponentState healthy = state == RunnerState::Running
                                           ? pb::COMPONENT_STATE_RUNNING
                                           : pb::COMPONENT_STATE_CONFIGURED;
    info.set_state(component.fault.empty() ? healthy : pb::COMPONENT_STATE_FAULTED);
    for (std::size_t i = 0; i < component.ports->size(); ++i) {
        const MappedPort& port = (*component.ports)[i];
        pb::PortInfo& message = *info.add_ports();
        setPortType(message, port.name, port.output, *port.type, port.texts);
        message.set_mapped_name(port.mapped_name);
        const ConnectionView& connection = graph.connectionOf(port);
        message.set_connected(connection.connected());
        message.set_mapped(port.output ? connection.published : connection.subscribed);
        message.set_broken(!port.output && graph.broken(position, i));
    }
    for (const ParameterView& parameter : component.parameters) {
        *info.add_parameters() = parameterTo(parameter.declaration, parameter.value);
    }
    for (const StateView& declared : component.states) {
        pb::StateInfo& message = *info.add_states();
        message.set_name(declared.name);
        message.set_type(declared.type);
        message.set_unit(declared.unit);
        message.set_doc(declared.doc);
        message.set_initial(declared.initial);
    }
    return info;
}

void addStates(pb::ComponentInfo& info, const std::vector<std::string>& values) {
    for (std::size_t i = 0; i < values.size(); ++i)
        info.mutable_states(static_cast<int>(i))->set_value(values[i]);
}

void addValues(pb::ComponentInfo& info, const std::vector<Probe::Value>& values) {
    for (std::size_t i = 0; i < values.size() && i < static_cast<std::size_t>(info.ports_size());
         ++i) {
        pb::PortInfo& port = *info.mutable_ports(static_cast<int>(i));
        if (!values[i].written) continue;
        port.set_value(values[i].text.value_or("(too large to show)"));
        port.set_age_ns(values[i].age_ns);
    }
}

v1::ListConnectionsResult connectionsTo(const GraphView& graph) {
    v1::ListConnectionsResult result;
    const auto set = [&](pb::Endpoint& message, const EndpointView& endpoint) {
        message.set_component(graph.components[endpoint.component]->full_name);
        message.set_port(graph.portOf(endpoint).name);
        message.set_broken(endpoint.broken);
    };
    for (const ConnectionView& connection : graph.connections) {
        pb::Connection& message = *result.add_connections();
        message.set_name(std::string(connection.name));
        message.set_type(connection.type->name);
        for (const EndpointView& writer : connection.writers)
            set(message.has_writer() ? *message.add_other_writers() : *message.mutable_writer(),
                writer);
        for (const EndpointView& reader : connection.readers) set(*message.add_readers(), reader);
        message.set_published(connection.published);
        message.set_subscribed(connection.subscribed);
    }
    return result;
}

pb::ComponentType typeTo(const std::string& package, const std::string& library,
                         const ComponentRecord& record, const Component& component) {
    pb::ComponentType type;
    type.set_package(package);
    type.set_type(record.type);
    type.set_library(library);
    type.set_doc(record.doc);
    for (const InputPort* input : accessTo(component).inputs()) {
        setPortType(*type.add_ports(), input->name(), false, input->type(), input->texts());
    }
    for (const OutputPort* output : accessTo(component).outputs()) {
        setPortType(*type.add_ports(), output->name(), true, output->type(), output->texts());
    }
    for (const ParameterBase* parameter : accessTo(component).parameters()) {
        *type.add_parameters() =
            parameterTo(parameter->declaration(), parameter->declaration().default_value);
    }
    for (const StateDeclaration& state : accessTo(component).states()) {
        pb::StateInfo& message = *type.add_states();
        message.set_name(state.name);
        message.set_type(state.type);
        message.set_unit(state.unit);
        message.set_doc(state.doc);
        message.set_initial(state.print(state.initial.data()));
    }
    return type;
}

}  // namespace rtcf::executor
