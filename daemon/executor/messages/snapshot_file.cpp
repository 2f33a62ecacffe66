#include "messages/snapshot_file.hpp"

#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <cstring>

#include "common/error.hpp"
#include "common/serialized.hpp"
#include "messages/parameter_value.hpp"
#include "rtcf/executor/v1/snapshot.pb.h"

namespace rtcf::executor {

namespace {

constexpr std::string_view kMagic = "RTCFSNAP";
constexpr std::uint32_t kVersion = 2;
constexpr std::size_t kHeader = 24;

std::uint32_t checksum(std::string_view bytes) {
    static const std::array<std::uint32_t, 256> kTable = [] {
        std::array<std::uint32_t, 256> table{};
        for (std::uint32_t i = 0; i < table.size(); ++i) {
            std::uint32_t remainder = i;
            for (int bit = 0; bit < 8; ++bit)
                remainder = (remainder >> 1U) ^ ((remainder & 1U) != 0 ? 0xedb88320U : 0U);
            table[i] = remainder;
        }
        return table;
    }();
    std::uint32_t sum = 0xffffffffU;
    for (const char byte : bytes)
        sum = (sum >> 8U) ^ kTable[(sum ^ static_cast<unsigned char>(byte)) & 0xffU];
    return ~sum;
}

// Little-endian, like both architectures that rtcf supports.
template <typename T>
T numberAt(std::string_view bytes, std::size_t offset) {
    T number = 0;
    std::memcpy(&number, bytes.data() + offset, sizeof number);
    return number;
}

template <typename T>
void append(std::string& bytes, T number) {
    bytes.append(reinterpret_cast<const char*>(&number), sizeof number);
}

[[noreturn]] void refuse(const std::string& why) { throw Error(ErrorKind::InvalidArgument, why); }

v1::PortType typeTo(const SnapshotType& type) {
    v1::PortType message;
    message.set_name(type.name);
    message.set_md5(type.md5);
    message.set_size(type.size);
    message.set_alignment(type.alignment);
    message.set_flat(type.flat);
    return message;
}

SnapshotType typeFrom(const v1::PortType& message) {
    return {message.name(), message.md5(), message.size(), message.alignment(), message.flat()};
}

v1::PortValue valueTo(const SnapshotValue& value) {
    v1::PortValue message;
    message.set_stamp(value.stamp);
    message.set_value(value.bytes);
    return message;
}

SnapshotValue valueFrom(const v1::PortValue& message) { return {message.stamp(), message.value()}; }

v1::ComponentSnapshot componentTo(const SnapshotComponent& component) {
    v1::ComponentSnapshot message;
    message.set_name(component.name);
    message.set_package(component.package);
    message.set_type(component.type);
    message.set_every(component.every);
    message.set_phase(component.phase);
    message.set_updated_ns(component.updated_ns);
    message.set_elapsed_ns(component.elapsed_ns);
    for (const auto& [name, value] : component.parameters) {
        auto& parameter = *message.add_parameters();
        parameter.set_name(name);
        *parameter.mutable_value() = parameterValueTo(value);
    }
    for (const SnapshotState& state : component.states) {
        v1::StateSnapshot& to = *message.add_states();
        to.set_name(state.name);
        to.set_type(state.type);
        to.set_identity(state.identity);
        to.set_value(state.bytes);
    }
    for (const SnapshotOutput& output : component.outputs) {
        v1::OutputSnapshot& to = *message.add_outputs();
        to.set_name(output.name);
        *to.mutable_type() = typeTo(output.type);
        *to.mutable_value() = valueTo(output.value);
        if (output.staged) *to.mutable_staged() = valueTo(*output.staged);
        if (output.latched) *to.mutable_latched() = valueTo(*output.latched);
    }
    for (const SnapshotInput& input : component.inputs) {
        v1::InputSnapshot& to = *message.add_inputs();
        to.set_name(input.name);
        *to.mutable_type() = typeTo(input.type);
        to.set_source(input.source);
        to.set_seen(input.seen);
        if (input.held) *to.mutable_held() = valueTo(*input.held);
    }
    return message;
}

SnapshotComponent componentFrom(const v1::ComponentSnapshot& message) {
    SnapshotComponent component{message.name(),
                                message.package(),
                                message.type(),
                                message.every(),
                                message.phase(),
                                message.updated_ns(),
                                message.elapsed_ns(),
                                {},
                                {},
                                {},
                                {}};
    for (const auto& parameter : message.parameters()) {
        component.parameters.emplace_back(parameter.name(),
                                          parameterValueFrom(parameter.value(), parameter.name()));
    }
    for (const v1::StateSnapshot& state : message.states())
        component.states.push_back({state.name(), state.type(), state.identity(), state.value()});
    for (const v1::OutputSnapshot& from : message.outputs()) {
        SnapshotOutput output{from.name(), typeFrom(from.type()), valueFrom(from.value()), {}, {}};
        if (from.has_staged()) output.staged = valueFrom(from.staged());
        if (from.has_latched()) output.latched = valueFrom(from.latched());
        component.outputs.push_back(std::move(output));
    }
    for (const v1::InputSnapshot& from : message.inputs()) {
        SnapshotInput input;
        input.name = from.name();
        input.type = typeFrom(from.type());
        input.source = from.source();
        input.seen = from.seen();
        if (from.has_held()) input.held = valueFrom(from.held());
        component.inputs.push_back(std::move(input));
    }
    return component;
}

}  // namespace

std::string snapshotToFile(const Snapshot& snapshot) {
    v1::RunnerSnapshot message;
    message.set_runner(snapshot.runner);
    message.set_taken_ns(snapshot.taken_ns);
    message.set_period_ns(snapshot.period_ns);
    message.set_iteration(snapshot.clock.iteration);
    message.set_time_ns(snapshot.clock.time_ns);
    message.set_stamp_ns(snapshot.clock.stamp_ns);
    message.set_elapsed_ns(snapshot.clock.elapsed_ns);
    message.set_total_elapsed_ns(snapshot.clock.total_elapsed_ns);
    for (const SnapshotComponent& component : snapshot.components)
        *message.add_components() = componentTo(component);
    for (const SnapshotTopic& topic : snapshot.topics) {
        v1::TopicSnapshot& to = *message.add_topics();
        to.set_name(topic.name);
        *to.mutable_type() = typeTo(topic.type);
        *to.mutable_value() = valueTo(topic.value);
    }
    const std::string body = serialized(message);
    std::string file(kMagic);
    append(file, kVersion);
    append(file, checksum(body));
    append(file, std::uint64_t{body.size()});
    return file + body;
}

Snapshot snapshotFromFile(std::string_view file) {
    if (file.size() < kHeader || file.substr(0, kMagic.size()) != kMagic)
        refuse("the file is not a snapshot: rtcfctl snapshot FILE makes one");
    if (const auto version = numberAt<std::uint32_t>(file, 8); version != kVersion) {
        refuse(fmt::format("the snapshot has format {}, this rtcf reads format {}: take a new one",
                           version, kVersion));
    }
    const std::string_view body = file.substr(kHeader);
    v1::RunnerSnapshot message;
    if (body.size() != numberAt<std::uint64_t>(file, 16) ||
        checksum(body) != numberAt<std::uint32_t>(file, 12) ||
        !message.ParseFromArray(body.data(), static_cast<int>(body.size())))
        refuse("the snapshot is damaged: its checksum is wrong; take a new one");
    Snapshot snapshot{message.runner(),
                      message.taken_ns(),
                      message.period_ns(),
                      {message.iteration(), message.time_ns(), message.stamp_ns(),
                       message.elapsed_ns(), message.total_elapsed_ns()},
                      {},
                      {}};
    for (const v1::ComponentSnapshot& component : message.components())
        snapshot.components.push_back(componentFrom(component));
    for (const v1::TopicSnapshot& topic : message.topics()) {
        snapshot.topics.push_back({topic.name(), typeFrom(topic.type()), valueFrom(topic.value())});
    }
    return snapshot;
}

}  // namespace rtcf::executor
