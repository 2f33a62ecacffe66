#include "image/image_restorer.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstring>

#include "common/refusal.hpp"

namespace rtcf::executor {

namespace {

constexpr std::size_t kToldProblems = 5;

std::string orNothing(const std::string& source) { return source.empty() ? "nothing" : source; }

}  // namespace

ImageRestorer::ImageRestorer(const RunnerImage& image, const Plan& plan)
    : image_(image), plan_(plan), sources_(plan) {
    for (const GraphNode& node : plan.graph.nodes()) {
        const auto& outputs = node.instance->component().outputs();
        for (std::size_t i = 0; i < outputs.size(); ++i) {
            outputs_[node.instance->fullName() + "." + outputs[i]->name()] = {
                outputs[i], node.instance->sample(i)};
        }
    }
    for (const auto& [name, injector] : plan.injectors) readers_[injector.get()];
    requireTimes();
    fitEach(
        {}, "component", image.components, plan.graph.nodes(),
        [](const GraphNode& node) { return node.instance->fullName(); },
        [&](const ImageComponent& component, const GraphNode& node) { fit(component, node); });
    if (problems_.empty()) fitTopics();
    requireFit();
    restoration_.clock = image.clock;
}

template <typename From, typename To, typename Name, typename Fit>
void ImageRestorer::fitEach(const std::string& of, const char* kind, const From& from, const To& to,
                            Name name, Fit fit) {
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

// Requires times that a loop can have, because components compute with them.
void ImageRestorer::requireTimes() const {
    constexpr std::int64_t kLongest = INT64_MAX / 2;
    constexpr std::int64_t kLastStamp = 4'294'967'295'999'999'999;  // of a ros::Time
    const auto is = [](std::int64_t time, std::int64_t most) { return time >= 0 && time <= most; };
    const auto isElapsed = [&](std::int64_t elapsed) {
        return is(elapsed, kLongest) && elapsed != 0 && elapsed % image_.period_ns == 0;
    };
    const auto isTurn = [&](const ImageComponent& component) {
        return is(component.updated_ns + 1, kLongest) && is(component.elapsed_ns, kLongest);
    };
    const ClockImage& clock = image_.clock;
    if (is(clock.time_ns, kLongest) && is(clock.stamp_ns, kLastStamp) &&
        is(clock.total_elapsed_ns, kLongest) && isElapsed(clock.elapsed_ns) &&
        std::all_of(image_.components.begin(), image_.components.end(), isTurn))
        return;
    throw Refusal(RefusalKind::InvalidArgument,
                  fmt::format("the snapshot of {} has an invalid clock (time {} ns, stamp "
                              "{} ns, elapsed {} ns): the file was modified; take another snapshot",
                              image_.runner, clock.time_ns, clock.stamp_ns, clock.elapsed_ns));
}

void ImageRestorer::requireFit() const {
    if (problems_.empty()) return;
    const auto told = static_cast<std::ptrdiff_t>(std::min(problems_.size(), kToldProblems));
    std::string text =
        fmt::format("{}", fmt::join(problems_.begin(), problems_.begin() + told, "; "));
    if (problems_.size() > kToldProblems)
        text += fmt::format("; and {} more", problems_.size() - kToldProblems);
    throw Refusal(RefusalKind::FailedPrecondition,
                  fmt::format("the snapshot of {} does not fit this graph: {}; load the graph that "
                              "it was taken from",
                              image_.runner, text));
}

void ImageRestorer::fit(const ImageComponent& image, const GraphNode& node) {
    Instance& instance = *node.instance;
    const ComponentDefinition& definition = instance.definition();
    if (image.type != definition.type) {
        problem(fmt::format("{} was a {} and is a {}", image.name, image.type, definition.type));
        return;
    }
    if (image.every != definition.every) {
        problem(fmt::format("{} ran every {} cycles and runs every {}", image.name, image.every,
                            definition.every));
    }
    if (image.phase >= std::max(1U, definition.every)) {
        problem(fmt::format("{} ran in cycle {} of {}", image.name, image.phase, image.every));
    } else if (image.phase != instance.phase()) {
        phases_[&instance] = image.phase;
    }
    restoration_.turns.push_back({&instance.context(), image.updated_ns, image.elapsed_ns});
    fitParameters(image, instance);
    fitStates(image, instance);
    fitOutputs(image, instance);
    fitInputs(image, instance);
}

void ImageRestorer::fitParameters(const ImageComponent& image, Instance& instance) {
    struct Named {
        std::string name;
        const ParameterValue* value;
    };
    std::vector<Named> from;
    for (const auto& [name, value] : image.parameters) from.push_back({name, &value});
    const auto& declared = instance.component().parameters();
    std::vector<std::size_t> to(declared.size());
    for (std::size_t i = 0; i < to.size(); ++i) to[i] = i;
    fitEach(
        image.name + ".", "parameter", from, to,
        [&](std::size_t i) { return declared[i]->declaration().name; },
        [&](const Named& parameter, std::size_t i) {
            if (!sameValue(*parameter.value, instance.parameterValues()[i]))
                parameters_[&instance].emplace_back(parameter.name, *parameter.value);
        });
}

void ImageRestorer::fitStates(const ImageComponent& image, const Instance& instance) {
    fitEach(
        image.name + ".", "state", image.states, instance.component().states(),
        [](const StateDeclaration& state) { return state.name; },
        [&](const ImageState& from, const StateDeclaration& to) {
            if (from.identity != to.identity || from.bytes.size() != to.size) {
                problem(fmt::format("state {}.{} was {} and is {}", image.name, to.name, from.type,
                                    to.type));
                return;
            }
            restoration_.states.push_back({to.value, from.bytes.data(), to.size});
        });
}

void ImageRestorer::fitOutputs(const ImageComponent& image, const Instance& instance) {
    fitEach(
        image.name + ".", "output", image.outputs, instance.component().outputs(),
        [](const OutputBase* output) { return output->name(); },
        [&](const ImageOutput& from, OutputBase* to) {
            const std::string name = image.name + "." + to->name();
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
                restoration_.staged.push_back(to);
            }
            if (from.latched) restoreTo(latch->second.get(), type, *from.latched, name);
        });
}

void ImageRestorer::fitInputs(const ImageComponent& image, const Instance& instance) {
    fitEach(
        image.name + ".", "input", image.inputs, instance.component().inputs(),
        [](const InputBase* input) { return input->name(); },
        [&](const ImageInput& from, InputBase* to) {
            fitInput(from, *to, image.name + "." + to->name());
        });
}

void ImageRestorer::fitInput(const ImageInput& image, InputBase& input, const std::string& name) {
    const TypeInfo& type = input.type();
    if (!same(image.type, type)) {
        problem(fmt::format("input {} was {} and is {}", name, image.type.name, type.name));
        return;
    }
    const std::string source = sources_.of(input);
    if (source != image.source) {
        problem(fmt::format("input {} read {} and reads {}", name, orNothing(image.source),
                            orNothing(source)));
        return;
    }
    Restoration::Input to{&input, {nullptr, nullptr, image.seen, image.kept_is_new}};
    const auto binding = plan_.bindings.find(&input);
    const bool was_bound = binding != plan_.bindings.end();
    if (source.empty() && image.seen != 0 && !image.left) {
        problem(fmt::format("input {} has read a removed writer, whose value is missing", name));
        return;
    }
    if (source.empty() && (image.left || was_bound)) {
        auto left = image.left ? slotFrom(type, *image.left, name) : type.make_slot(nullptr);
        restoration_.headers.push_back(left.get());
        to.reading.source = left.get();
        kept_[&input].left = std::move(left);
    }
    if (!image.reads_source) {
        std::shared_ptr<SlotHeader> kept;
        if (!image.kept_of.empty()) {
            const auto output = outputs_.find(image.kept_of);
            if (output == outputs_.end() || !sameType(output->second.first->type(), type)) {
                problem(fmt::format("input {} has a value of {}, which does not exist", name,
                                    image.kept_of));
                return;
            }
            kept = output->second.first->slot();
        } else {
            kept = image.kept ? slotFrom(type, *image.kept, name) : type.make_slot(nullptr);
            restoration_.headers.push_back(kept.get());
        }
        to.reading.current = kept.get();
        kept_[&input].kept = std::move(kept);
    }
    const auto readers = was_bound
                             ? readers_.find(static_cast<const Injector*>(binding->second.writer))
                             : readers_.end();
    (readers != readers_.end() ? readers->second : restoration_.inputs).push_back(to);
}

void ImageRestorer::fitTopics() {
    fitEach(
        {}, "topic", image_.topics, plan_.injectors, [](const auto& each) { return each.first; },
        [&](const ImageTopic& from, const auto& each) {
            Injector& to = *each.second;
            if (!same(from.type, to.type())) {
                problem(fmt::format("topic {} was {} and is {}", from.name, from.type.name,
                                    to.type().name));
                return;
            }
            restoration_.topics.push_back(
                {&to, slotFrom(to.type(), from.value, from.name), from.sequence, readers_[&to]});
        });
}

std::shared_ptr<SlotHeader> ImageRestorer::slotFrom(const TypeInfo& type, const ImageValue& value,
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
    slot->sequence = value.sequence;
    slot->time_ns = value.time_ns;
    return slot;
}

void ImageRestorer::restoreTo(SlotHeader* to, const TypeInfo& type, const ImageValue& value,
                              const std::string& name) {
    const SlotHeader* const sample = outputs_.at(name).second;
    restoration_.values.push_back({&type, to, slotFrom(type, value, name, sample)});
    restoration_.headers.push_back(to);
    if (!type.flat) reserved_[to] = {name, sample};
}

void ImageRestorer::requireReserved() const {
    for (const Restoration::Value& value : restoration_.values) {
        if (value.type->flat) continue;
        const auto& [name, sample] = reserved_.at(value.to);
        const std::uint32_t room = value.type->length(*sample);
        const std::uint32_t length = value.type->length(*value.from);
        if (length <= room) continue;
        throw Refusal(RefusalKind::ResourceExhausted,
                      fmt::format("the value of {} has {} bytes, its component has reserved {}: "
                                  "restore it while the loop does not run, or reserve() more",
                                  name, length, room));
    }
}

void ImageRestorer::noteIn(Plan& plan) const {
    for (const auto& [input, kept] : kept_) {
        Binding& binding = plan.bindings[input];
        if (kept.left) {
            binding.source = kept.left.get();
            binding.source_owner = kept.left;
        }
        binding.kept = kept.kept.get();
        binding.kept_owner = kept.kept;
    }
}

}  // namespace rtcf::executor
