#include "messages/convert.hpp"

#include <fmt/format.h>

#include "messages/image_file.hpp"
#include "messages/parameter_value.hpp"

namespace rtcf::executor {

namespace pb = ::rtcf::v1;

namespace {

constexpr std::uint32_t kKilo = 1024;

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
    return info;
}

void setPortType(pb::PortInfo& info, const std::string& name, bool output, const TypeInfo& type) {
    info.set_name(name);
    info.set_direction(output ? pb::DIRECTION_OUTPUT : pb::DIRECTION_INPUT);
    info.set_type(type.name);
    info.set_md5(type.md5);
}

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
    spec.set_first(definition.first);
    spec.set_ignore(definition.ignore);
    for (const std::string& port : definition.breaks) spec.add_breaks(port);
    spec.set_every(definition.every);
    if (definition.phase) spec.set_phase(*definition.phase);
    spec.set_optional(definition.optional);
    return spec;
}

Right rightFrom(pb::Right right) {
    switch (right) {
        case pb::RIGHT_OBSERVE:
            return Right::Observe;
        case pb::RIGHT_TUNE:
            return Right::Tune;
        case pb::RIGHT_OPERATE:
            return Right::Operate;
        case pb::RIGHT_ADMIN:
            return Right::Admin;
        default:
            return Right::None;
    }
}

pb::Right rightTo(Right right) {
    switch (right) {
        case Right::None:
            break;
        case Right::Observe:
            return pb::RIGHT_OBSERVE;
        case Right::Tune:
            return pb::RIGHT_TUNE;
        case Right::Operate:
            return pb::RIGHT_OPERATE;
        case Right::Admin:
            return pb::RIGHT_ADMIN;
    }
    return pb::RIGHT_NONE;
}

OverrunPolicy overrunFrom(pb::OverrunPolicy policy) {
    if (policy == pb::OVERRUN_POLICY_CATCH_UP) return OverrunPolicy::CatchUp;
    if (policy == pb::OVERRUN_POLICY_RELATIVE) return OverrunPolicy::Relative;
    return OverrunPolicy::Skip;
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

SimTime simTimeFrom(pb::SimTime choice) {
    switch (choice) {
        case pb::SIM_TIME_NEVER:
            return SimTime::Never;
        case pb::SIM_TIME_ALWAYS:
            return SimTime::Always;
        default:
            return SimTime::Auto;
    }
}

pb::SimTime simTimeTo(SimTime choice) {
    switch (choice) {
        case SimTime::Never:
            return pb::SIM_TIME_NEVER;
        case SimTime::Always:
            return pb::SIM_TIME_ALWAYS;
        case SimTime::Auto:
            break;
    }
    return pb::SIM_TIME_AUTO;
}

pb::OverrunPolicy overrunTo(OverrunPolicy policy) {
    if (policy == OverrunPolicy::CatchUp) return pb::OVERRUN_POLICY_CATCH_UP;
    if (policy == OverrunPolicy::Relative) return pb::OVERRUN_POLICY_RELATIVE;
    return pb::OVERRUN_POLICY_SKIP;
}

}  // namespace

ComponentDefinition definitionFrom(const pb::ComponentSpec& spec) {
    ComponentDefinition definition;
    definition.name = spec.name().empty() ? spec.type() : spec.name();
    requireLength("component name", definition.name);
    requireLength("package", spec.package());
    requireLength("type", spec.type());
    if (!isBaseName(definition.name)) {
        throw Refusal(RefusalKind::NameInvalid,
                      fmt::format("'{}' is not a legal component name: a letter, then letters, "
                                  "digits and _; give the "
                                  "namespace by --ns",
                                  definition.name));
    }
    definition.ns = canonicalNamespace(spec.ns());
    requireLength("component name", definition.fullName());
    definition.package = spec.package();
    definition.type = spec.type();
    for (const auto& remap : spec.remaps()) {
        for (const std::string& name : {remap.source(), remap.target()}) {
            requireLength("remap", name);
            if (isGraphName(name)) continue;
            throw Refusal(RefusalKind::NameInvalid,
                          fmt::format("remap {}:={}: '{}' is not a legal ROS name", remap.source(),
                                      remap.target(), name));
        }
        definition.remaps.emplace_back(remap.source(), remap.target());
    }
    definition.parameters = parametersFrom(spec.parameters());
    definition.first = spec.first();
    definition.ignore = spec.ignore();
    for (const std::string& port : spec.breaks()) requireLength("port", port);
    definition.breaks.insert(spec.breaks().begin(), spec.breaks().end());
    definition.every = std::max(1U, spec.every());
    definition.optional = spec.optional();
    constexpr std::uint32_t kSlowest = 100000;
    if (definition.every > kSlowest) {
        throw Refusal(RefusalKind::InvalidArgument,
                      fmt::format("{}: every {} cycles is out of range: 1 to {}",
                                  definition.fullName(), definition.every, kSlowest));
    }
    if (spec.has_phase()) {
        if (spec.phase() >= definition.every) {
            throw Refusal(RefusalKind::InvalidArgument,
                          fmt::format("{}: phase {} is out of range: 0 to {} with --every {}",
                                      definition.fullName(), spec.phase(), definition.every - 1,
                                      definition.every));
        }
        definition.phase = spec.phase();
    }
    return definition;
}

ComponentDefinition replacementFrom(const pb::ComponentSpec& spec, const ComponentDefinition& old) {
    pb::ComponentSpec full = spec;
    const pb::ComponentSpec before = specTo(old);
    if (full.name().empty()) full.set_name(before.name());
    if (full.ns().empty()) full.set_ns(before.ns());
    if (full.remaps().empty()) *full.mutable_remaps() = before.remaps();
    if (!full.first()) full.set_first(before.first());
    if (full.ignore().empty()) full.set_ignore(before.ignore());
    if (full.breaks().empty()) *full.mutable_breaks() = before.breaks();
    if (full.every() == 0) {
        full.set_every(before.every());
        if (!full.has_phase() && before.has_phase()) full.set_phase(before.phase());
    }
    if (!full.optional()) full.set_optional(before.optional());
    return definitionFrom(full);
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

AccessRules rulesFrom(const v1::AccessRules& message) {
    AccessRules rules;
    rules.others = rightFrom(message.others());
    for (const auto& entry : message.users()) rules.users[entry.id()] = rightFrom(entry.right());
    for (const auto& entry : message.groups()) rules.groups[entry.id()] = rightFrom(entry.right());
    if (message.has_door_group()) rules.door_group = message.door_group();
    rules.door_open = message.door_open();
    return rules;
}

RunnerSettings settingsFrom(const pb::RunnerSettings& message, RunnerSettings base) {
    if (message.has_frequency_hz()) base.frequency_hz = message.frequency_hz();
    RealtimeSettings& realtime = base.loop.realtime;
    if (message.has_cpu()) realtime.cpu = message.cpu();
    if (message.has_priority()) realtime.priority = message.priority();
    if (message.has_spin_us()) base.loop.spin_ns = std::int64_t{message.spin_us()} * 1000;
    if (message.has_realtime() && message.realtime() != pb::REALTIME_UNSPECIFIED) {
        base.realtime_required = message.realtime() == pb::REALTIME_REQUIRED;
    }
    if (message.has_overrun()) base.loop.overrun = overrunFrom(message.overrun());
    if (message.has_max_overruns()) base.loop.max_overruns = message.max_overruns();
    if (message.has_lock_memory()) realtime.lock_memory = message.lock_memory();
    if (message.has_heap_kb()) realtime.heap_bytes = std::size_t{message.heap_kb()} * kKilo;
    if (message.has_stack_kb()) realtime.stack_bytes = std::size_t{message.stack_kb()} * kKilo;
    if (message.has_warmup_cycles()) base.loop.warmup_cycles = message.warmup_cycles();
    if (message.has_stall_timeout_ms())
        base.stall_timeout_ns = std::int64_t{message.stall_timeout_ms()} * 1'000'000;
    if (message.has_orphan_timeout_s()) {
        base.orphan_timeout_ns = static_cast<std::int64_t>(message.orphan_timeout_s() * 1e9);
    }
    if (message.has_spin_auto()) base.spin_auto = message.spin_auto();
    if (message.has_on_boot()) base.on_boot = message.on_boot();
    if (message.has_on_crash()) base.on_crash = message.on_crash();
    if (message.has_log_limit()) base.log_limit = message.log_limit();
    if (message.has_sim_time()) base.sim_time = simTimeFrom(message.sim_time());
    if (message.has_max_clock_jump_s()) {
        base.max_clock_jump_ns = static_cast<std::int64_t>(message.max_clock_jump_s() * 1e9);
    }
    const pb::RosSettings& ros = message.ros();
    if (ros.has_enabled()) base.bridge.enabled = ros.enabled();
    if (ros.has_master_uri()) base.bridge.master_uri = ros.master_uri();
    if (ros.has_hostname()) base.bridge.hostname = ros.hostname();
    if (ros.has_ns()) base.bridge.name_space = ros.ns();
    if (ros.has_queue()) base.bridge.queue = ros.queue();
    if (ros.has_latch()) base.bridge.latch = ros.latch();
    if (ros.has_decimation()) base.bridge.decimation = ros.decimation();
    if (ros.has_decimate()) base.bridge.decimate = ros.decimate();
    if (ros.has_stamped()) base.bridge.stamped = ros.stamped();
    if (ros.has_largest_message_kb()) {
        // What does not fit is out of range anyway.
        base.bridge.largest_message =
            std::min(ros.largest_message_kb(), UINT32_MAX / 1024) * std::uint32_t{1024};
    }
    if (ros.has_peers() && ros.peers() != pb::RIGHT_UNSPECIFIED)
        base.bridge.peers = rightFrom(ros.peers());
    if (ros.has_refuse_out_of_range()) base.bridge.refuse_out_of_range = ros.refuse_out_of_range();
    if (ros.has_whitelist()) base.whitelist = ros.whitelist();
    if (ros.has_blacklist()) base.blacklist = ros.blacklist();
    return base;
}

pb::RunnerSettings settingsTo(const RunnerSettings& settings) {
    pb::RunnerSettings message;
    message.set_frequency_hz(settings.frequency_hz);
    message.set_cpu(settings.loop.realtime.cpu);
    message.set_priority(settings.loop.realtime.priority);
    message.set_spin_us(static_cast<std::uint32_t>(settings.loop.spin_ns / 1000));
    message.set_realtime(settings.realtime_required ? pb::REALTIME_REQUIRED
                                                    : pb::REALTIME_PREFERRED);
    message.set_overrun(overrunTo(settings.loop.overrun));
    message.set_max_overruns(settings.loop.max_overruns);
    message.set_lock_memory(settings.loop.realtime.lock_memory);
    message.set_heap_kb(static_cast<std::uint32_t>(settings.loop.realtime.heap_bytes / kKilo));
    message.set_stack_kb(static_cast<std::uint32_t>(settings.loop.realtime.stack_bytes / kKilo));
    message.set_warmup_cycles(static_cast<std::uint32_t>(settings.loop.warmup_cycles));
    message.set_stall_timeout_ms(static_cast<std::uint32_t>(settings.stall_timeout_ns / 1'000'000));
    message.set_orphan_timeout_s(static_cast<double>(settings.orphan_timeout_ns) / 1e9);
    message.set_spin_auto(settings.spin_auto);
    message.set_on_boot(static_cast<pb::OnBoot>(settings.on_boot));
    message.set_on_crash(static_cast<pb::OnCrash>(settings.on_crash));
    message.set_log_limit(settings.log_limit);
    message.set_sim_time(simTimeTo(settings.sim_time));
    message.set_max_clock_jump_s(static_cast<double>(settings.max_clock_jump_ns) / 1e9);
    pb::RosSettings& ros = *message.mutable_ros();
    ros.set_enabled(settings.bridge.enabled);
    ros.set_master_uri(settings.bridge.master_uri);
    ros.set_hostname(settings.bridge.hostname);
    ros.set_ns(settings.bridge.name_space);
    ros.set_queue(settings.bridge.queue);
    ros.set_latch(settings.bridge.latch);
    ros.set_decimation(settings.bridge.decimation);
    ros.set_decimate(settings.bridge.decimate);
    ros.set_stamped(settings.bridge.stamped);
    ros.set_largest_message_kb(settings.bridge.largest_message / 1024);
    ros.set_peers(rightTo(settings.bridge.peers));
    ros.set_refuse_out_of_range(settings.bridge.refuse_out_of_range);
    ros.set_whitelist(settings.whitelist);
    ros.set_blacklist(settings.blacklist);
    return message;
}

std::vector<std::pair<std::string, ParameterValue>> parametersFrom(
    const google::protobuf::RepeatedPtrField<pb::ParameterSetting>& settings) {
    std::vector<std::pair<std::string, ParameterValue>> parameters;
    for (const auto& setting : settings) {
        requireLength("parameter", setting.name());
        parameters.emplace_back(setting.name(),
                                parameterValueFrom(setting.value(), setting.name()));
    }
    return parameters;
}

ReplayChunk replayFrom(const pb::ReplayRequest& request) {
    ReplayChunk chunk;
    chunk.begin = request.begin();
    chunk.start_ns = request.start_ns();
    for (const pb::RecordedTopic& topic : request.topics())
        chunk.topics.push_back({topic.topic(), topic.type(), topic.md5(), {}});
    for (const pb::RecordedMessage& message : request.messages()) {
        if (!chunk.messages.empty() && message.time_ns() < chunk.messages.back().time_ns) {
            throw Refusal(RefusalKind::RecordingInvalid,
                          fmt::format("a message of {} is before the one that precedes it: "
                                      "messages of a replay come in order of time",
                                      message.topic()));
        }
        chunk.messages.push_back({message.topic(), message.time_ns(), message.data()});
    }
    chunk.until_ns = request.until_ns();
    chunk.end = request.end();
    return chunk;
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

namespace {

std::pair<v1::Error::Code, pb::Reason> codeAndReason(RefusalKind kind) {
    switch (kind) {
        case RefusalKind::RequestMalformed:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_REQUEST_MALFORMED};
        case RefusalKind::InvalidArgument:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_VALUE_INVALID};
        case RefusalKind::NameMissing:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_NAME_MISSING};
        case RefusalKind::NameInvalid:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_NAME_INVALID};
        case RefusalKind::TextTooLong:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_TEXT_TOO_LONG};
        case RefusalKind::ExpressionInvalid:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_EXPRESSION_INVALID};
        case RefusalKind::ComponentTwice:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_COMPONENT_TWICE};
        case RefusalKind::RatesConflict:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_RATES_CONFLICT};
        case RefusalKind::RecordingInvalid:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_RECORDING_INVALID};
        case RefusalKind::NotFound:
            return {v1::Error::CODE_NOT_FOUND, pb::REASON_COMPONENT_NOT_FOUND};
        case RefusalKind::PortNotFound:
            return {v1::Error::CODE_NOT_FOUND, pb::REASON_PORT_NOT_FOUND};
        case RefusalKind::ParameterNotFound:
            return {v1::Error::CODE_NOT_FOUND, pb::REASON_PARAMETER_NOT_FOUND};
        case RefusalKind::TypeNotFound:
            return {v1::Error::CODE_NOT_FOUND, pb::REASON_TYPE_NOT_FOUND};
        case RefusalKind::AlreadyExists:
            return {v1::Error::CODE_ALREADY_EXISTS, pb::REASON_COMPONENT_EXISTS};
        case RefusalKind::FailedPrecondition:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_COMPONENT_REFUSED};
        case RefusalKind::TypesDiffer:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_TYPES_DIFFER};
        case RefusalKind::ConnectionsFormLoop:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_CONNECTIONS_FORM_LOOP};
        case RefusalKind::TwoWriters:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_TWO_WRITERS};
        case RefusalKind::TwoPacers:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_TWO_PACERS};
        case RefusalKind::LibraryRefused:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_LIBRARY_REFUSED};
        case RefusalKind::HookFailed:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_HOOK_FAILED};
        case RefusalKind::NoMaster:
            return {v1::Error::CODE_NO_MASTER, pb::REASON_NO_MASTER};
        case RefusalKind::NoRealtime:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_NO_REALTIME};
        case RefusalKind::NoState:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_NO_STATE};
        case RefusalKind::LoopRuns:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_LOOP_RUNS};
        case RefusalKind::LoopFailed:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_LOOP_FAILED};
        case RefusalKind::LoopStopped:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_LOOP_STOPPED};
        case RefusalKind::ReplayRuns:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_REPLAY_RUNS};
        case RefusalKind::NoReplay:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_NO_REPLAY};
        case RefusalKind::Unavailable:
            return {v1::Error::CODE_UNAVAILABLE, pb::REASON_LOOP_STUCK};
        case RefusalKind::ResourceExhausted:
            return {v1::Error::CODE_RESOURCE_EXHAUSTED, pb::REASON_LIMIT_REACHED};
        case RefusalKind::StateTooLarge:
            return {v1::Error::CODE_RESOURCE_EXHAUSTED, pb::REASON_STATE_TOO_LARGE};
    }
    return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_COMPONENT_REFUSED};
}

}  // namespace

v1::Error errorTo(RefusalKind kind, const std::string& message) {
    v1::Error error;
    const auto [code, reason] = codeAndReason(kind);
    error.set_code(code);
    error.set_reason(reason);
    error.set_message(message);
    return error;
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

v1::Snapshot snapshotTo(const ImageOutcome& outcome) {
    constexpr std::size_t kLargest = 15 * 1024 * 1024;
    v1::Snapshot message;
    message.set_snapshot(imageToFile(outcome.image));
    if (message.snapshot().size() > kLargest) {
        throw Refusal(
            RefusalKind::ResourceExhausted,
            fmt::format("the snapshot of {} has {} bytes, at most {}: declare less state, "
                        "or divide the graph among runners",
                        outcome.image.runner, message.snapshot().size(), kLargest));
    }
    message.set_iteration(outcome.image.clock.iteration);
    for (const std::string& line : outcome.notes) message.add_notes(line);
    return message;
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

v1::DirectStop directStopTo(const DirectStopReport& report) {
    v1::DirectStop message;
    message.set_count(report.count);
    message.set_uid(report.user);
    message.set_pid(report.pid);
    message.set_at_ns(report.at_ns);
    return message;
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

pb::ComponentInfo componentTo(const GraphSnapshot& snapshot, std::size_t position,
                              RunnerState state) {
    const ComponentSnapshot& component = *snapshot.components[position];
    pb::ComponentInfo info;
    info.set_full_name(component.full_name);
    *info.mutable_spec() = specTo(component.definition);
    info.set_position(static_cast<std::uint32_t>(position));
    info.set_library(component.library);
    info.set_doc(component.doc);
    info.set_fault(component.fault);
    info.set_faults(component.figures->faults.count.value());
    const pb::ComponentState healthy = state == RunnerState::Running
                                           ? pb::COMPONENT_STATE_RUNNING
                                           : pb::COMPONENT_STATE_CONFIGURED;
    info.set_state(component.fault.empty() ? healthy : pb::COMPONENT_STATE_FAULTED);
    for (const PortSnapshot& port : component.ports) {
        pb::PortInfo& message = *info.add_ports();
        setPortType(message, port.name, port.output, *port.type);
        message.set_mapped_name(port.mapped_name);
        message.set_unit(port.unit);
        const ConnectionSnapshot& connection = snapshot.connections.at(port.mapped_name);
        message.set_connected(connection.writer.has_value() && !connection.readers.empty());
        message.set_mapped(port.output ? connection.published : connection.subscribed);
        for (const EndpointSnapshot& reader : connection.readers) {
            if (!port.output && reader.component == component.full_name &&
                reader.port == port.name) {
                message.set_broken(reader.broken);
            }
        }
    }
    for (const ParameterSnapshot& parameter : component.parameters) {
        *info.add_parameters() = parameterTo(parameter.declaration, parameter.value);
    }
    for (const StateSnapshot& declared : component.states) {
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
        port.set_count(port.direction() == pb::DIRECTION_OUTPUT ? values[i].sequence
                                                                : values[i].seen);
        if (values[i].sequence == 0) continue;
        port.set_value(values[i].text.value_or("(too large to show)"));
        port.set_age_ns(values[i].age_ns);
    }
}

v1::ListConnectionsResult connectionsTo(const GraphSnapshot& snapshot) {
    v1::ListConnectionsResult result;
    const auto set = [](pb::Endpoint& message, const EndpointSnapshot& endpoint) {
        message.set_component(endpoint.component);
        message.set_port(endpoint.port);
        message.set_broken(endpoint.broken);
    };
    for (const auto& [name, connection] : snapshot.connections) {
        pb::Connection& message = *result.add_connections();
        message.set_name(name);
        message.set_type(connection.type);
        if (connection.writer) set(*message.mutable_writer(), *connection.writer);
        for (const EndpointSnapshot& writer : connection.other_writers)
            set(*message.add_other_writers(), writer);
        for (const EndpointSnapshot& reader : connection.readers)
            set(*message.add_readers(), reader);
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
    for (const InputBase* input : component.inputs()) {
        setPortType(*type.add_ports(), input->name(), false, input->type());
    }
    for (const OutputBase* output : component.outputs()) {
        pb::PortInfo& port = *type.add_ports();
        setPortType(port, output->name(), true, output->type());
        port.set_unit(output->unit());
    }
    for (const ParameterBase* parameter : component.parameters()) {
        *type.add_parameters() =
            parameterTo(parameter->declaration(), parameter->declaration().default_value);
    }
    for (const StateDeclaration& state : component.states()) {
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
