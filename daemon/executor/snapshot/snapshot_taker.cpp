#include "snapshot/snapshot_taker.hpp"

#include <fmt/format.h>

#include "common/error.hpp"

namespace rtcf::executor {

namespace {

const Instance& instanceOf(const Plan& plan, std::size_t step) {
    return *plan.graph.nodes()[plan.wiring.order[step]].instance;
}

SnapshotValue valueFrom(const Capture::Value& value) {
    return {value.header.stamp,
            std::string(value.bytes.begin(), value.bytes.begin() + value.length)};
}

// Requires that values can be copied in the cycle.
void requireCopied(const TypeInfo& type) {
    if (!allocatesMessage(type)) return;
    throw Error(ErrorKind::FailedPrecondition,
                fmt::format("a snapshot cannot contain values of {}: they own memory, "
                            "and so do messages of {}, which would be allocated in the cycle; "
                            "store the values in a std::array",
                            type.name, type.ros_type));
}

}  // namespace

Sources::Sources(const Plan& plan) : plan_(plan) {
    for (const GraphNode& node : plan.graph.nodes()) {
        for (const OutputPort* output : accessTo(node.instance->component()).outputs())
            names_[output->slot().get()] = node.instance->fullName() + "." + output->name();
    }
    for (const auto& [topic, injector] : plan.injectors) names_[injector.get()] = "topic " + topic;
}

std::string Sources::of(const InputPort& input) const {
    const auto found = plan_.bindings.find(&input);
    if (found == plan_.bindings.end() || found->second.writer == nullptr) return {};
    const Binding& binding = found->second;
    const bool late = binding.source != nullptr && binding.source != binding.writer;
    return names_.at(binding.writer) + (late ? " one cycle late" : "");
}

SnapshotTaker::SnapshotTaker(const Plan& plan) : plan_(plan), sources_(plan) {
    for (std::size_t step = 0; step < plan.wiring.order.size(); ++step) {
        const Instance& instance = instanceOf(plan, step);
        const Component& component = instance.component();
        capture_.turns.push_back({&accessTo(component).context()});
        states_.emplace_back();
        std::size_t size = 0;
        for (const StateDeclaration& state : accessTo(component).states()) size += state.size;
        states_.back().resize(size);
        std::byte* to = states_.back().data();
        for (const StateDeclaration& state : accessTo(component).states()) {
            capture_.states.push_back({to, state.value, state.size});
            to += state.size;
        }
        const auto& outputs = accessTo(component).outputs();
        for (std::size_t port = 0; port < outputs.size(); ++port) {
            const OutputPort& output = *outputs[port];
            const SlotHeader* const slot = output.slot().get();
            add(output.type(), slot, instance.sample(port));
            if (output.written() != slot)
                add(output.type(), output.written(), instance.sample(port));
            if (const auto latch = plan.latches.find(slot); latch != plan.latches.end())
                add(output.type(), latch->second.get(), instance.sample(port));
        }
        for (const InputPort* input : accessTo(component).inputs()) addInput(*input);
    }
    for (const auto& [name, injector] : plan.injectors) {
        const TypeInfo& type = injector->type();
        requireCopied(type);
        capture_.topics.push_back(
            {injector.get(),
             {&type, nullptr, std::vector<std::uint8_t>(type.flat ? type.size : 0)}});
    }
}

void SnapshotTaker::add(const TypeInfo& type, const SlotHeader* slot, const SlotHeader* sample) {
    requireCopied(type);
    if (slot == nullptr || !values_.emplace(slot, capture_.values.size()).second) return;
    std::size_t room = type.size;
    if (!type.flat) room = sample != nullptr ? type.length(*sample) : 0;
    capture_.values.push_back({&type, slot, std::vector<std::uint8_t>(room)});
}

void SnapshotTaker::addInput(const InputPort& input) {
    const auto found = plan_.bindings.find(&input);
    const Binding binding = found == plan_.bindings.end() ? Binding{} : found->second;
    const bool is_bound = binding.writer != nullptr;
    const bool from_outside = is_bound && binding.source == nullptr;
    // Without a writer, or with a new one, it may have the value of a removed one.
    const bool may_hold = is_bound ? binding.held_owner != nullptr : found != plan_.bindings.end();
    if (may_hold) requireCopied(input.type());
    const std::size_t room = may_hold && input.type().flat ? input.type().size : 0;
    capture_.inputs.push_back(
        {&input,
         is_bound ? binding.source : nullptr,
         from_outside ? static_cast<const Injector*>(binding.writer) : nullptr,
         {&input.type(), nullptr, std::vector<std::uint8_t>(room)}});
}

void SnapshotTaker::makeRoom() {
    const auto enlarge = [](Capture::Value& value) {
        if (value.bytes.size() < value.length) value.bytes.resize(value.length);
    };
    for (Capture::Value& value : capture_.values) enlarge(value);
    for (Capture::Input& input : capture_.inputs) enlarge(input.held);
    for (Capture::Topic& topic : capture_.topics) enlarge(topic.value);
}

SnapshotValue SnapshotTaker::valueAt(const SlotHeader* slot) const {
    return valueFrom(capture_.values[values_.at(slot)]);
}

SnapshotInput SnapshotTaker::inputOf(const Capture::Input& input) const {
    SnapshotInput result;
    result.name = input.input->name();
    result.type = snapshotTypeOf(input.input->type());
    result.source = sources_.of(*input.input);
    result.seen = input.seen;
    if (input.held.from != nullptr) result.held = valueFrom(input.held);
    return result;
}

SnapshotComponent SnapshotTaker::componentOf(std::size_t step) const {
    const Instance& instance = instanceOf(plan_, step);
    const Component& component = instance.component();
    SnapshotComponent result;
    result.name = instance.fullName();
    result.package = instance.definition().package;
    result.type = instance.definition().type;
    result.every = instance.definition().every;
    result.phase = instance.phase();
    result.updated_ns = capture_.turns[step].updated_ns;
    result.elapsed_ns = capture_.turns[step].elapsed_ns;
    const auto& parameters = accessTo(component).parameters();
    for (std::size_t i = 0; i < parameters.size(); ++i)
        result.parameters.emplace_back(parameters[i]->declaration().name,
                                       instance.parameterValues()[i]);
    const char* state_bytes = reinterpret_cast<const char*>(states_[step].data());
    for (const StateDeclaration& state : accessTo(component).states()) {
        result.states.push_back(
            {state.name, state.type, state.identity, std::string(state_bytes, state.size)});
        state_bytes += state.size;
    }
    for (const OutputPort* output : accessTo(component).outputs()) {
        const SlotHeader* const slot = output->slot().get();
        SnapshotOutput port{output->name(), snapshotTypeOf(output->type()), valueAt(slot), {}, {}};
        if (output->written() != slot) port.staged = valueAt(output->written());
        if (const auto latch = plan_.latches.find(slot); latch != plan_.latches.end())
            port.latched = valueAt(latch->second.get());
        result.outputs.push_back(std::move(port));
    }
    return result;
}

Snapshot SnapshotTaker::snapshot() const {
    Snapshot result;
    result.clock = capture_.clock;
    auto input = capture_.inputs.begin();
    for (std::size_t step = 0; step < plan_.wiring.order.size(); ++step) {
        const Instance& instance = instanceOf(plan_, step);
        if (capture_.turns[step].disabled) {
            throw Error(ErrorKind::FailedPrecondition,
                        fmt::format("{0} was taken out after a fault, so its state is unknown: "
                                    "replace or unload it first",
                                    instance.fullName()));
        }
        result.components.push_back(componentOf(step));
        for (std::size_t i = 0; i < accessTo(instance.component()).inputs().size(); ++i)
            result.components.back().inputs.push_back(inputOf(*input++));
    }
    for (const Capture::Topic& topic : capture_.topics) {
        result.topics.push_back({topic.injector->topic(), snapshotTypeOf(topic.injector->type()),
                                 valueFrom(topic.value)});
    }
    return result;
}

}  // namespace rtcf::executor
