#include "snapshot/snapshot_restorer.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdint>
#include <cstring>

#include "common/error.hpp"
#include "realtime/cycle_counter.hpp"

namespace rtcf::executor {

namespace {

constexpr std::size_t kReportedProblems = 5;
constexpr std::int64_t kLongest = INT64_MAX / 2;  // ns

std::string orNothing(const std::string& source) { return source.empty() ? "nothing" : source; }

}  // namespace

SnapshotRestorer::SnapshotRestorer(const Snapshot& saved, const Plan& plan, bool running)
    : snapshot_(saved), plan_(plan), running_(running), sources_(plan) {
    for (const GraphNode& node : plan.graph.nodes()) {
        const auto& outputs = accessTo(node.instance->component()).outputs();
        for (std::size_t i = 0; i < outputs.size(); ++i) {
            outputs_[node.instance->fullName() + "." + outputs[i]->name()] = {
                outputs[i], node.instance->sample(i)};
        }
    }
    for (const auto& [name, injector] : plan.injectors) readers_[injector.get()];
    requireTimes();
    fitEach(
        {}, "component", saved.components, plan.graph.nodes(),
        [](const GraphNode& node) { return node.instance->fullName(); },
        [&](const SnapshotComponent& component, const GraphNode& node) { fit(component, node); });
    if (problems_.empty()) fitTopics();
    requireFit();
    restoration_.clock = saved.clock;
}

template <typename From, typename To, typename Name, typename Fit>
void SnapshotRestorer::fitEach(const std::string& of, const char* kind, const From& from,
                               const To& to, Name name, Fit fit) {
    std::map<std::string, const typename From::value_type*> there;
    for (const auto& each : from) there[each.name] = &each;
    if (there.size() != from.size()) problem(fmt::format("a {} is in the snapshot twice", kind));
    for (const auto& each : to) {
        const std::string wanted = name(each);
        const auto found = there.find(wanted);
        if (found == there.end()) {
            problem(fmt::format("{} {}{} is not in the snapshot", kind, of, wanted));
            continue;
        }
        fit(*found->second, each);
        there.erase(found);
    }
    for (const auto& [left, each] : there)
        problem(fmt::format("the graph has no {} {}{}", kind, of, left));
}

// Components compute with the ages of values.
void SnapshotRestorer::checkStamp(std::int64_t stamp, const std::string& name) {
    if (stamp < -kLongest || stamp > kLongest)
        problem(fmt::format("{} has the time {} ns: the file was modified", name, stamp));
}

// Requires times that a loop can have, because components compute with them.
void SnapshotRestorer::requireTimes() const {
    constexpr std::int64_t kLastStamp = 4'294'967'295'999'999'999;  // of a ros::Time
    const auto is = [](std::int64_t time, std::int64_t most) { return time >= 0 && time <= most; };
    const auto isElapsed = [&](std::int64_t elapsed) {
        return is(elapsed, kLongest) && elapsed != 0 && elapsed % snapshot_.period_ns == 0;
    };
    const auto isTurn = [&](const SnapshotComponent& component) {
        return is(component.updated_ns + 1, kLongest) && is(component.elapsed_ns, kLongest);
    };
    const ClockState& clock = snapshot_.clock;
    if (is(clock.time_ns, kLongest) && is(clock.stamp_ns, kLastStamp) &&
        is(clock.total_elapsed_ns, kLongest) && isElapsed(clock.elapsed_ns) &&
        std::all_of(snapshot_.components.begin(), snapshot_.components.end(), isTurn))
        return;
    throw Error(ErrorKind::InvalidArgument,
                fmt::format("the snapshot of {} has an invalid clock (time {} ns, stamp "
                            "{} ns, elapsed {} ns): the file was modified; take another snapshot",
                            snapshot_.runner, clock.time_ns, clock.stamp_ns, clock.elapsed_ns));
}

void SnapshotRestorer::requireFit() const {
    if (problems_.empty()) return;
    const auto reported =
        static_cast<std::ptrdiff_t>(std::min(problems_.size(), kReportedProblems));
    std::string text =
        fmt::format("{}", fmt::join(problems_.begin(), problems_.begin() + reported, "; "));
    if (problems_.size() > kReportedProblems)
        text += fmt::format("; and {} more", problems_.size() - kReportedProblems);
    throw Error(ErrorKind::FailedPrecondition,
                fmt::format("the snapshot of {} does not fit this graph: {}; load the graph that "
                            "it was taken from",
                            snapshot_.runner, text));
}

void SnapshotRestorer::fit(const SnapshotComponent& saved, const GraphNode& node) {
    Instance& instance = *node.instance;
    const ComponentDefinition& definition = instance.definition();
    if (saved.type != definition.type) {
        problem(fmt::format("{} was a {} and is a {}", saved.name, saved.type, definition.type));
        return;
    }
    if (saved.every != definition.every) {
        problem(fmt::format("{} ran every {} cycles and runs every {}", saved.name, saved.every,
                            definition.every));
    }
    if (saved.phase >= std::max(1U, definition.every)) {
        problem(fmt::format("{} ran in cycle {} of {}", saved.name, saved.phase, saved.every));
    } else if (saved.phase != instance.phase()) {
        phases_[&instance] = saved.phase;
    }
    restoration_.turns.push_back({&instance.context(), saved.updated_ns, saved.elapsed_ns});
    fitParameters(saved, instance);
    fitStates(saved, instance);
    fitOutputs(saved, instance);
    fitInputs(saved, instance);
}

void SnapshotRestorer::fitParameters(const SnapshotComponent& saved, Instance& instance) {
    struct Named {
        std::string name;
        const ParameterValue* value;
    };
    std::vector<Named> from;
    for (const auto& [name, value] : saved.parameters) from.push_back({name, &value});
    const auto& declared = accessTo(instance.component()).parameters();
    std::vector<std::size_t> to(declared.size());
    for (std::size_t i = 0; i < to.size(); ++i) to[i] = i;
    fitEach(
        saved.name + ".", "parameter", from, to,
        [&](std::size_t i) { return declared[i]->declaration().name; },
        [&](const Named& parameter, std::size_t i) {
            if (!sameValue(*parameter.value, instance.parameterValues()[i]))
                parameters_[&instance].emplace_back(parameter.name, *parameter.value);
        });
}

void SnapshotRestorer::fitStates(const SnapshotComponent& saved, const Instance& instance) {
    fitEach(
        saved.name + ".", "state", saved.states, accessTo(instance.component()).states(),
        [](const StateDeclaration& state) { return state.name; },
        [&](const SnapshotState& from, const StateDeclaration& to) {
            if (from.identity != to.identity || from.bytes.size() != to.size) {
                problem(fmt::format("state {}.{} was {} and is {}", saved.name, to.name, from.type,
                                    to.type));
                return;
            }
            if (!running_ || !to.live)
                restoration_.states.push_back({to.value, from.bytes.data(), to.size});
        });
}

void SnapshotRestorer::fitOutputs(const SnapshotComponent& saved, const Instance& instance) {
    fitEach(
        saved.name + ".", "output", saved.outputs, accessTo(instance.component()).outputs(),
        [](const OutputPort* output) { return output->name(); },
        [&](const SnapshotOutput& from, OutputPort* to) {
            const std::string name = saved.name + "." + to->name();
            const TypeInfo& type = to->type();
            if (!same(from.type, type)) {
                problem(fmt::format("output {} was {} and is {}", name, from.type.name, type.name));
                return;
            }
            SlotHeader* const slot = to->slot().get();
            const bool is_staged = to->written() != slot;
            const auto latch = plan_.latches.find(slot);
            if (is_staged != from.staged.has_value() ||
                (latch != plan_.latches.end()) != from.latched.has_value()) {
                problem(fmt::format("output {} is checked or read one cycle late, unlike before",
                                    name));
                return;
            }
            restoreTo(slot, type, from.value, name);
            if (is_staged) {
                restoreTo(to->written(), type, *from.staged, name);
            }
            if (from.latched) restoreTo(latch->second.get(), type, *from.latched, name);
        });
}

void SnapshotRestorer::fitInputs(const SnapshotComponent& saved, const Instance& instance) {
    fitEach(
        saved.name + ".", "input", saved.inputs, accessTo(instance.component()).inputs(),
        [](const InputPort* input) { return input->name(); },
        [&](const SnapshotInput& from, InputPort* to) {
            fitInput(from, *to, saved.name + "." + to->name());
        });
}

void SnapshotRestorer::fitInput(const SnapshotInput& saved, InputPort& input,
                                const std::string& name) {
    const TypeInfo& type = input.type();
    if (!same(saved.type, type)) {
        problem(fmt::format("input {} was {} and is {}", name, saved.type.name, type.name));
        return;
    }
    const std::string source = sources_.of(input);
    if (source != saved.source) {
        problem(fmt::format("input {} read {} and reads {}", name, orNothing(saved.source),
                            orNothing(source)));
        return;
    }
    if (source.empty() && saved.seen != 0 && !saved.held) {
        problem(fmt::format("input {} has read a removed writer, whose value is missing", name));
        return;
    }
    checkStamp(saved.seen, name);
    const auto found = plan_.bindings.find(&input);
    const Binding binding = found == plan_.bindings.end() ? Binding{} : found->second;
    Restoration::Input to{&input, source.empty() ? nullptr : binding.source, nullptr, saved.seen};
    // Without a writer and a value, but bound before: the value goes.
    const bool is_emptied = source.empty() && found != plan_.bindings.end();
    if (saved.held || is_emptied) {
        auto held = saved.held ? slotFrom(type, *saved.held, name) : type.make_slot(nullptr);
        restoration_.headers.push_back(held.get());
        to.held = held.get();
        held_[&input] = std::move(held);
    }
    const auto readers = readers_.find(static_cast<const Injector*>(binding.writer));
    (readers != readers_.end() ? readers->second : restoration_.inputs).push_back(to);
}

void SnapshotRestorer::fitTopics() {
    fitEach(
        {}, "topic", snapshot_.topics, plan_.injectors, [](const auto& each) { return each.first; },
        [&](const SnapshotTopic& from, const auto& each) {
            Injector& to = *each.second;
            if (!same(from.type, to.type())) {
                problem(fmt::format("topic {} was {} and is {}", from.name, from.type.name,
                                    to.type().name));
                return;
            }
            // Newer values must not give way to older ones, e.g. that of a pressed button.
            if (running_) return;
            restoration_.topics.push_back({&to, slotFrom(to.type(), from.value, from.name),
                                           arrivalOf(from.value), readers_[&to]});
        });
}

// Arrival of a value from outside, CLOCK_MONOTONIC, ns. The machine may have booted since.
std::int64_t SnapshotRestorer::arrivalOf(const SnapshotValue& value) const {
    const std::int64_t now = realtimeNow();
    const std::int64_t since_snapshot = now - std::clamp<std::int64_t>(snapshot_.taken_ns, 0, now);
    const std::int64_t time = snapshot_.clock.time_ns;
    const std::int64_t age = time - std::clamp(value.stamp, time - kLongest / 2, time);
    return monotonicNow() - since_snapshot - age;
}

std::shared_ptr<SlotHeader> SnapshotRestorer::slotFrom(const TypeInfo& type,
                                                       const SnapshotValue& value,
                                                       const std::string& name,
                                                       const SlotHeader* sample) {
    std::shared_ptr<SlotHeader> slot = type.make_slot(sample);
    const auto* const bytes = reinterpret_cast<const std::uint8_t*>(value.bytes.data());
    bool valid = false;
    if (type.flat) {
        valid = value.bytes.size() == type.size;
        if (valid) std::memcpy(valueOf(type, *slot), bytes, type.size);
    } else {
        valid = type.deserialize(*slot, bytes, static_cast<std::uint32_t>(value.bytes.size()));
    }
    if (!valid) problem(fmt::format("the value of {} is not of type {}", name, type.name));
    checkStamp(value.stamp, name);
    slot->stamp = value.stamp;
    return slot;
}

void SnapshotRestorer::restoreTo(SlotHeader* to, const TypeInfo& type, const SnapshotValue& value,
                                 const std::string& name) {
    const SlotHeader* const sample = outputs_.at(name).second;
    restoration_.values.push_back({&type, to, slotFrom(type, value, name, sample)});
    restoration_.headers.push_back(to);
    if (!type.flat) reserved_[to] = {name, sample};
}

void SnapshotRestorer::requireReserved() const {
    for (const Restoration::Value& value : restoration_.values) {
        if (value.type->flat) continue;
        const auto& [name, sample] = reserved_.at(value.to);
        const std::uint32_t room = value.type->length(*sample);
        const std::uint32_t length = value.type->length(*value.from);
        if (length <= room) continue;
        throw Error(ErrorKind::ResourceExhausted,
                    fmt::format("the value of {} has {} bytes, its component has reserved {}: "
                                "restore it while the loop does not run, or reserve() more",
                                name, length, room));
    }
}

void SnapshotRestorer::noteIn(Plan& plan) const {
    for (const auto& [input, held] : held_) {
        Binding& binding = plan.bindings[input];
        binding.held = held.get();
        binding.held_owner = held;
    }
}

}  // namespace rtcf::executor
