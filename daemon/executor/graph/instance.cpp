#include "graph/instance.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <utility>

#include "common/error.hpp"
#include "common/thrown.hpp"
#include "graph/fitted_value.hpp"
#include "graph/inherited_parameters.hpp"
#include "realtime/component_arena.hpp"

namespace rtcf::executor {

namespace {

const ComponentRecord& findRecord(const Library& library, const ComponentDefinition& definition) {
    if (const ComponentRecord* record = library.find(definition.type)) return *record;
    std::string names;
    for (const ComponentRecord* record : library.types())
        names += (names.empty() ? "" : ", ") + std::string(record->type);
    throw Error(ErrorKind::TypeNotFound,
                fmt::format("{} has no component type {}; it has {}", library.path(),
                            definition.type, names.empty() ? "none" : names));
}

std::string parameterNames(const Component& component) {
    std::string names;
    for (const ParameterBase* parameter : accessTo(component).parameters()) {
        names += (names.empty() ? "" : ", ") + parameter->declaration().name;
    }
    return names.empty() ? "none" : names;
}

// Notes a hook in the flight recorder and in the gate to ROS while it runs.
class HookNote {
   public:
    HookNote(FlightRecorder& recorder, std::uint32_t slot, Hook hook, HookGate* gate,
             const std::string& component)
        : recorder_(recorder), gate_(gate) {
        recorder_.enterHook(slot, hook);
        if (gate_ != nullptr) gate_->enter(component);
    }
    ~HookNote() {
        (void)unanswered();
        recorder_.leaveHook();
    }
    HookNote(const HookNote&) = delete;
    HookNote& operator=(const HookNote&) = delete;

    // A call of the hook that the ROS master did not answer; empty = none. After the hook has
    // returned.
    std::string unanswered() {
        HookGate* const gate = std::exchange(gate_, nullptr);
        return gate != nullptr ? gate->leave() : std::string();
    }

   private:
    FlightRecorder& recorder_;
    HookGate* gate_;
};

}  // namespace

Instance::Instance(ComponentDefinition definition, std::shared_ptr<const Library> library,
                   const std::string& runner, const LoopClock& clock, Log& log,
                   FlightRecorder& recorder, HookGate* gate)
    : definition_(std::make_shared<ComponentDefinition>(std::move(definition))),
      library_(std::move(library)),
      record_(&findRecord(*library_, *definition_)),
      log_(log),
      recorder_(recorder),
      gate_(gate),
      slot_(recorder, definition_->fullName()),
      drained_(log),
      phase_(definition_->phase) {
    context_.full_name = definition_->fullName();
    context_.name = definition_->name;
    context_.ns = definition_->ns;
    context_.runner = runner;
    context_.clock = &clock;
    context_.period_ns = clock.period_ns * definition_->every;
    context_.recorder_slot = slot();
    context_.device = &statistics_->device;
    context_.faults = &statistics_->faults;
    context_.log = &log;
    context_.memory = ComponentArena::ofProcess();
    level_.emplace(log.levels(), context_);
    context_.gate = gate;
    for (const auto& [from, to] : definition_->remaps) {
        context_.remaps.emplace_back(resolveName(from, context_.ns, context_.full_name),
                                     resolveName(to, context_.ns, context_.full_name));
    }
    callHook(Hook::Constructor, [this] {
        component_.reset(record_->create(definition_->name.c_str(), &context_));
        return true;
    });
    accessTo(*component_).attach(context_);
    for (const ParameterBase* parameter : accessTo(*component_).parameters()) {
        parameter_values_.push_back(parameter->declaration().default_value);
    }
    accessTo(*component_).freezeParameters();
    setFirstParameters();
}

Instance::~Instance() {
    stop();
    cleanup();
    const HookNote note(recorder_, slot(), Hook::Destructor, nullptr, context_.full_name);
    component_.reset();
}

void Instance::setFirstParameters() {
    auto batch = definition_->parameters;
    KeptParameters kept =
        inheritedParameters(definition_->inherited, accessTo(*component_).parameters(), batch,
                            fmt::format("{}/{}", definition_->package, definition_->type));
    kept_parameters_ = std::move(kept.kept);
    lost_parameters_ = std::move(kept.notes);
    batch.insert(batch.end(), kept_parameters_.begin(), kept_parameters_.end());
    for (StagedValue* value : stageParameters(batch)) value->commit();
    releaseStaged();
    has_parameters_ = true;
    definition_->parameters = std::move(batch);
    definition_->inherited.clear();
}

// Calls a hook. If it fails, throws an Error with the hook's error text, or the text of its
// exception.
void Instance::callHook(Hook hook, const std::function<bool()>& call) {
    HookNote note(recorder_, slot(), hook, gate_, context_.full_name);
    ErrorKind kind = ErrorKind::HookFailed;
    std::string why;
    if (component_ != nullptr) accessTo(*component_).clearFailure();
    try {
        const bool passed = call();
        why = note.unanswered();
        if (!why.empty()) {
            kind = ErrorKind::NoMaster;
        } else if (passed) {
            return;
        } else {
            why = accessTo(*component_).failure().empty()
                      ? "it returned false without an error text"
                      : accessTo(*component_).failure();
        }
    } catch (const Error&) {
        throw;
    } catch (const NoMaster& error) {
        kind = ErrorKind::NoMaster;
        why = error.what();
    } catch (const std::exception& error) {
        why = fmt::format("it threw: {}", textOf(error));
    } catch (...) {
        why = "it threw an exception of unknown type";
    }
    throw Error(kind, fmt::format("{} ({}/{}): {} failed: {}", context_.full_name,
                                  definition_->package, definition_->type, hookName(hook), why));
}

void Instance::callLastHook(Hook hook, const std::function<void()>& call) noexcept {
    HookNote note(recorder_, slot(), hook, gate_, context_.full_name);
    std::string why;
    try {
        call();
        why = note.unanswered();
    } catch (const std::exception& error) {
        why = fmt::format("it threw: {}", textOf(error));
    } catch (...) {
        why = "it threw an exception of unknown type";
    }
    // The component is leaving, so the failure cannot reject anything.
    if (why.empty()) return;
    log_.write(LogLevel::Error, context_.full_name, fmt::format("{}: {}", hookName(hook), why));
}

// Stamps of a hook's writes: later than those of the last cycle and of earlier hooks, and earlier
// than those of the next cycle. A constructor's writes have the stamp 1.
void Instance::setHookTime() noexcept {
    accessTo(*component_)
        .setTime(std::max<std::int64_t>(context_.clock->time_ns + 2, component_->time() + 1));
}

void Instance::configure() {
    if (configured_) return;
    // cleanup() also undoes a configure() that fails halfway.
    configured_ = true;
    setHookTime();
    try {
        callHook(Hook::Configure, [this] { return component_->configure(); });
        requireMembers();
    } catch (...) {
        cleanup();
        throw;
    }
    freezePorts();
}

void Instance::requireMembers() const {
    const std::vector<std::string>& ended = accessTo(*component_).ended();
    if (ended.empty()) return;
    throw Error(ErrorKind::HookFailed,
                fmt::format("{} ({}/{}): {} ended before the component: make it a member of the "
                            "class, and keep it to the end",
                            context_.full_name, definition_->package, definition_->type, ended[0]));
}

void Instance::freezePorts() {
    accessTo(*component_).freeze();
    accessTo(*component_).stageOutputs([this](const OutputPort& output) {
        return definition_->optional || !isShared(output.type());
    });
    if (definition_->optional) statistics_->faults.taken_out.allocateText();
    if (!accessTo(*component_).stagedOutputs().empty()) statistics_->faults.unsafe.allocateText();
    const auto mapped = [this](const std::string& port) {
        std::string name =
            mappedName(port, definition_->ns, context_.full_name, definition_->remaps);
        requireLength("mapped name", name);
        return name;
    };
    const auto& inputs = accessTo(*component_).inputs();
    const auto& outputs = accessTo(*component_).outputs();
    auto ports = std::make_shared<std::vector<MappedPort>>();
    ports->reserve(inputs.size() + outputs.size());
    for (const InputPort* input : inputs)
        ports->push_back(
            {input->name(), mapped(input->name()), input->texts(), &input->type(), false});
    for (const OutputPort* output : outputs) {
        ports->push_back(
            {output->name(), mapped(output->name()), output->texts(), &output->type(), true});
        samples_.push_back(output->type().make_slot(output->sample()));
    }
    ports_ = std::move(ports);
    for (const std::string& port : definition_->breaks.ports) {
        if (findInput(port) != nullptr) continue;
        throw Error(ErrorKind::PortNotFound,
                    fmt::format("{} has no input {} to break", context_.full_name, port));
    }
}

void Instance::start() {
    if (started_) return;
    setHookTime();
    callHook(Hook::Start, [this] {
        if (!component_->start()) return false;
        // Publishes first values for components that run earlier in the schedule. The cycle reports
        // values that are not finite.
        for (OutputPort* output : accessTo(*component_).stagedOutputs())
            if (output->valid()) output->commit();
        return true;
    });
    for (MailboxBase* mailbox : accessTo(*component_).mailboxes()) mailbox->open();
    started_ = true;
}

void Instance::stop() noexcept {
    if (!started_) return;
    started_ = false;
    // First ends calls that wait in a callback: stop() may wait for the callback.
    for (MailboxBase* mailbox : accessTo(*component_).mailboxes()) mailbox->close();
    setHookTime();
    callLastHook(Hook::Stop, [this] { component_->stop(); });
}

void Instance::cleanup() noexcept {
    if (!configured_) return;
    configured_ = false;
    callLastHook(Hook::Cleanup, [this] { component_->cleanup(); });
}

std::vector<std::string> Instance::uselessRemaps() const {
    std::vector<std::string> useless;
    for (const auto& [from, to] : definition_->remaps) {
        const std::string resolved = resolveName(from, definition_->ns, context_.full_name);
        const auto is_port = [&](const auto* port) {
            return resolveName(port->name(), definition_->ns, context_.full_name) == resolved;
        };
        const auto& inputs = accessTo(*component_).inputs();
        const auto& outputs = accessTo(*component_).outputs();
        if (std::none_of(inputs.begin(), inputs.end(), is_port) &&
            std::none_of(outputs.begin(), outputs.end(), is_port)) {
            useless.push_back(from + ":=" + to);
        }
    }
    return useless;
}

InputPort* Instance::findInput(const std::string& port) const noexcept {
    for (InputPort* input : accessTo(*component_).inputs()) {
        if (input->name() == port) return input;
    }
    return nullptr;
}

const InputPort& Instance::requireInput(const std::string& port) const {
    if (const InputPort* const found = findInput(port)) return *found;
    std::string names;
    for (const InputPort* input : accessTo(*component_).inputs())
        names += (names.empty() ? "" : ", ") + input->name();
    throw Error(ErrorKind::PortNotFound, fmt::format("{} has no input {}; it has {}", fullName(),
                                                     port, names.empty() ? "none" : names));
}

void Instance::restoreParameterValues(std::vector<ParameterValue> values) {
    parameter_values_ = std::move(values);
    releaseStaged();
}

void Instance::releaseStaged() noexcept {
    for (ParameterBase* parameter : accessTo(*component_).parameters()) parameter->release();
    for (DerivedBase* derived : accessTo(*component_).derived()) derived->release();
}

std::vector<StagedValue*> Instance::stageParameters(
    const std::vector<std::pair<std::string, ParameterValue>>& batch) {
    const auto& declared = accessTo(*component_).parameters();
    std::vector<std::pair<std::size_t, ParameterValue>> checked;
    for (const auto& [name, given] : batch) {
        const auto found = std::find_if(declared.begin(), declared.end(),
                                        [&name = name](const ParameterBase* parameter) {
                                            return parameter->declaration().name == name;
                                        });
        if (found == declared.end()) {
            throw Error(ErrorKind::ParameterNotFound,
                        fmt::format("{} has no parameter {}; it has {}", context_.full_name, name,
                                    parameterNames(*component_)));
        }
        ParameterValue value = given;
        fit((*found)->declaration(), value);
        if (const std::string why = (*found)->check(value); !why.empty()) {
            throw Error(ErrorKind::InvalidArgument, fmt::format("{}: {}", context_.full_name, why));
        }
        const auto index = static_cast<std::size_t>(found - declared.begin());
        if (has_parameters_ && (*found)->declaration().fixed &&
            !sameValue(value, parameter_values_[index])) {
            throw Error(ErrorKind::FailedPrecondition,
                        fmt::format("{}: parameter {} is fixed at the load: `rtcfctl replace` with "
                                    "--param {}:={} or `rtcfctl apply` of a graph file replaces "
                                    "the component, also in a running loop",
                                    context_.full_name, name, name, parameterText(given)));
        }
        checked.emplace_back(index, std::move(value));
    }
    for (const auto& [index, value] : checked) declared[index]->stage(value);
    try {
        callHook(Hook::Prepare, [this] { return component_->prepare(Values{}); });
    } catch (...) {
        releaseStaged();
        throw;
    }
    std::vector<StagedValue*> staged;
    for (ParameterBase* parameter : declared) {
        if (parameter->staged()) staged.push_back(parameter);
    }
    for (DerivedBase* derived : accessTo(*component_).derived()) {
        if (derived->staged()) staged.push_back(derived);
    }
    for (auto& [index, value] : checked) parameter_values_[index] = std::move(value);
    return staged;
}

}  // namespace rtcf::executor
