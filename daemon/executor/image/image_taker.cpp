#include "image/image_taker.hpp"

#include <fmt/format.h>

#include "common/refusal.hpp"

namespace rtcf::executor {

namespace {

const Instance& instanceOf(const Plan& plan, std::size_t step) {
    return *plan.graph.nodes()[plan.wiring.order[step]].instance;
}

ImageValue valueFrom(const Capture::Value& value) {
    return {value.header.sequence, value.header.time_ns,
            std::string(value.bytes.begin(), value.bytes.begin() + value.length)};
}

// Requires that values can be copied in the cycle.
void requireCopied(const TypeInfo& type) {
    if (!allocatesMessage(type)) return;
    throw Refusal(RefusalKind::FailedPrecondition,
                  fmt::format("a snapshot cannot contain values of {}: they own memory, "
                              "and so do messages of {}, which would be allocated in the cycle; "
                              "store the values in a std::array",
                              type.name, type.ros_type));
}

// The slot that an input without a writer still reads; null if it never had a writer.
const SlotHeader* leftBy(const Binding& binding) {
    if (binding.writer != nullptr) return nullptr;
    if (binding.source != nullptr || binding.source_owner == nullptr) return binding.source;
    return static_cast<const Injector*>(binding.source_owner.get())->front();
}

}  // namespace

Sources::Sources(const Plan& plan) : plan_(plan) {
    for (const GraphNode& node : plan.graph.nodes()) {
        for (const OutputBase* output : node.instance->component().outputs())
            names_[output->slot().get()] = node.instance->fullName() + "." + output->name();
    }
    for (const auto& [topic, injector] : plan.injectors) names_[injector.get()] = "topic " + topic;
}

std::string Sources::output(const SlotHeader* slot) const {
    const auto found = names_.find(slot);
    return found == names_.end() ? std::string() : found->second;
}

std::string Sources::of(const InputBase& input) const {
    const auto found = plan_.bindings.find(&input);
    if (found == plan_.bindings.end() || found->second.writer == nullptr) return {};
    const Binding& binding = found->second;
    const bool late = binding.source != nullptr && binding.source != binding.writer;
    return names_.at(binding.writer) + (late ? " one cycle late" : "");
}

ImageTaker::ImageTaker(const Plan& plan) : plan_(plan), sources_(plan) {
    for (std::size_t step = 0; step < plan.wiring.order.size(); ++step) {
        const Instance& instance = instanceOf(plan, step);
        const Component& component = instance.component();
        capture_.turns.push_back({&component.context()});
        states_.emplace_back();
        std::size_t size = 0;
        for (const StateDeclaration& state : component.states()) size += state.size;
        states_.back().resize(size);
        std::byte* to = states_.back().data();
        for (const StateDeclaration& state : component.states()) {
            capture_.states.push_back({to, state.value, state.size});
            to += state.size;
        }
        const auto& outputs = component.outputs();
        for (std::size_t port = 0; port < outputs.size(); ++port) {
            const OutputBase& output = *outputs[port];
            const SlotHeader* const slot = output.slot().get();
            add(output.type(), slot, instance.sample(port));
            if (output.written() != slot)
                add(output.type(), output.written(), instance.sample(port));
            if (const auto latch = plan.latches.find(slot); latch != plan.latches.end())
                add(output.type(), latch->second.get(), instance.sample(port));
        }
        for (const InputBase* input : component.inputs()) {
            capture_.inputs.push_back({input});
            const auto binding = plan.bindings.find(input);
            if (binding == plan.bindings.end()) continue;
            add(input->type(), leftBy(binding->second), nullptr);
            add(input->type(), binding->second.kept, nullptr);
        }
    }
    for (const auto& [name, injector] : plan.injectors) {
        const TypeInfo& type = injector->type();
        requireCopied(type);
        capture_.topics.push_back(
            {injector.get(),
             {&type, nullptr, std::vector<std::uint8_t>(type.flat ? type.size : 0)}});
    }
}

void ImageTaker::add(const TypeInfo& type, const SlotHeader* slot, const SlotHeader* sample) {
    requireCopied(type);
    if (slot == nullptr || !values_.emplace(slot, capture_.values.size()).second) return;
    std::size_t room = type.size;
    if (!type.flat) room = sample != nullptr ? type.length(*sample) : 0;
    capture_.values.push_back({&type, slot, std::vector<std::uint8_t>(room)});
}

void ImageTaker::makeRoom() {
    const auto enlarge = [](Capture::Value& value) {
        if (value.bytes.size() < value.length) value.bytes.resize(value.length);
    };
    for (Capture::Value& value : capture_.values) enlarge(value);
    for (Capture::Topic& topic : capture_.topics) enlarge(topic.value);
}

ImageValue ImageTaker::valueAt(const SlotHeader* slot) const {
    return valueFrom(capture_.values[values_.at(slot)]);
}

ImageInput ImageTaker::inputOf(const InputBase& input, const InputBase::Reading& reading) const {
    ImageInput image;
    image.name = input.name();
    image.type = imageTypeOf(input.type());
    image.source = sources_.of(input);
    image.seen = reading.seen;
    image.kept_is_new = reading.kept_is_new;
    image.reads_source = reading.current == reading.source;
    const auto binding = plan_.bindings.find(&input);
    if (binding == plan_.bindings.end()) return image;
    if (const SlotHeader* const left = leftBy(binding->second); left != nullptr)
        image.left = valueAt(left);
    if (image.reads_source || reading.current != binding->second.kept) return image;
    image.kept_of = sources_.output(reading.current);
    if (image.kept_of.empty()) image.kept = valueAt(reading.current);
    return image;
}

ImageComponent ImageTaker::componentOf(std::size_t step) const {
    const Instance& instance = instanceOf(plan_, step);
    const Component& component = instance.component();
    ImageComponent image;
    image.name = instance.fullName();
    image.package = instance.definition().package;
    image.type = instance.definition().type;
    image.every = instance.definition().every;
    image.phase = instance.phase();
    image.updated_ns = capture_.turns[step].updated_ns;
    image.elapsed_ns = capture_.turns[step].elapsed_ns;
    const auto& parameters = component.parameters();
    for (std::size_t i = 0; i < parameters.size(); ++i)
        image.parameters.emplace_back(parameters[i]->declaration().name,
                                      instance.parameterValues()[i]);
    const char* state_bytes = reinterpret_cast<const char*>(states_[step].data());
    for (const StateDeclaration& state : component.states()) {
        image.states.push_back(
            {state.name, state.type, state.identity, std::string(state_bytes, state.size)});
        state_bytes += state.size;
    }
    for (const OutputBase* output : component.outputs()) {
        const SlotHeader* const slot = output->slot().get();
        ImageOutput port{output->name(), imageTypeOf(output->type()), valueAt(slot), {}, {}};
        if (output->written() != slot) port.staged = valueAt(output->written());
        if (const auto latch = plan_.latches.find(slot); latch != plan_.latches.end())
            port.latched = valueAt(latch->second.get());
        image.outputs.push_back(std::move(port));
    }
    return image;
}

RunnerImage ImageTaker::image() const {
    RunnerImage image;
    image.clock = capture_.clock;
    auto input = capture_.inputs.begin();
    for (std::size_t step = 0; step < plan_.wiring.order.size(); ++step) {
        const Instance& instance = instanceOf(plan_, step);
        if (capture_.turns[step].disabled) {
            throw Refusal(RefusalKind::FailedPrecondition,
                          fmt::format("{0} was taken out after a fault, so its state is unknown: "
                                      "replace or unload it first",
                                      instance.fullName()));
        }
        image.components.push_back(componentOf(step));
        for (const InputBase* port : instance.component().inputs()) {
            image.components.back().inputs.push_back(inputOf(*port, input->reading));
            ++input;
        }
    }
    for (const Capture::Topic& topic : capture_.topics) {
        image.topics.push_back({topic.injector->topic(), imageTypeOf(topic.injector->type()),
                                topic.sequence, valueFrom(topic.value)});
    }
    return image;
}

}  // namespace rtcf::executor
