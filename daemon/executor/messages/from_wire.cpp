#include "messages/from_wire.hpp"

#include <fmt/format.h>

#include <set>

#include "common/error.hpp"
#include "messages/parameter_value.hpp"
#include "messages/settings_messages.hpp"
#include "messages/to_wire.hpp"

namespace rtcf::executor {

namespace pb = ::rtcf::v1;

ComponentDefinition definitionFrom(const pb::ComponentSpec& spec) {
    ComponentDefinition definition;
    definition.name = spec.name().empty() ? spec.type() : spec.name();
    requireLength("component name", definition.name);
    requireLength("package", spec.package());
    requireLength("type", spec.type());
    if (!isBaseName(definition.name)) {
        throw Error(ErrorKind::NameInvalid,
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
            throw Error(ErrorKind::NameInvalid,
                        fmt::format("remap {}:={}: '{}' is not a legal ROS name", remap.source(),
                                    remap.target(), name));
        }
        definition.remaps.emplace_back(remap.source(), remap.target());
    }
    definition.parameters = parametersFrom(spec.parameters());
    definition.breaks.first = spec.first();
    definition.breaks.ignore = NamePattern("ignore of " + definition.fullName(), spec.ignore());
    for (const std::string& port : spec.breaks()) requireLength("port", port);
    definition.breaks.ports.insert(spec.breaks().begin(), spec.breaks().end());
    definition.every = std::max(1U, spec.every());
    definition.optional = spec.optional();
    constexpr std::uint32_t kSlowest = 100000;
    if (definition.every > kSlowest) {
        throw Error(ErrorKind::InvalidArgument,
                    fmt::format("{}: every {} cycles is out of range: 1 to {}",
                                definition.fullName(), definition.every, kSlowest));
    }
    if (spec.has_phase()) {
        if (spec.phase() >= definition.every) {
            throw Error(ErrorKind::InvalidArgument,
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

std::vector<std::pair<std::string, ParameterValue>> parametersFrom(
    const google::protobuf::RepeatedPtrField<pb::ParameterSetting>& settings) {
    std::vector<std::pair<std::string, ParameterValue>> parameters;
    std::set<std::string> names;
    for (const auto& setting : settings) {
        requireLength("parameter", setting.name());
        if (!names.insert(setting.name()).second) {
            throw Error(ErrorKind::InvalidArgument,
                        fmt::format("parameter {} is set twice in one change: give it one value",
                                    setting.name()));
        }
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
            throw Error(ErrorKind::RecordingInvalid,
                        fmt::format("a message of {} is earlier than the one before it: "
                                    "messages of a replay must be in order of time",
                                    message.topic()));
        }
        chunk.messages.push_back({message.topic(), message.time_ns(), message.data()});
    }
    chunk.until_ns = request.until_ns();
    chunk.end = request.end();
    return chunk;
}

}  // namespace rtcf::executor
