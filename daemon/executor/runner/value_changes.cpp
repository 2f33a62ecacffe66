#include "runner/value_changes.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "common/error.hpp"
#include "logging/log_errors.hpp"
#include "state/state_value.hpp"

namespace rtcf::executor {

ValueChanges::ValueChanges(std::string runner, const Loop& loop, LoopBoundary& boundary,
                           LoopControl& control, ActivePlan& plan, const Publication& publication,
                           BridgeLink& bridge, Transactions& transactions, Log& log)
    : runner_(std::move(runner)),
      loop_(loop),
      boundary_(boundary),
      control_(control),
      plan_(plan),
      publication_(publication),
      bridge_(bridge),
      transactions_(transactions),
      log_(log) {}

ChangeOutcome ValueChanges::reset(const std::string& name) {
    const Component& component = plan_->graph.get(name).instance->component();
    if (accessTo(component).states().empty()) {
        throw Error(ErrorKind::NoState,
                    fmt::format("{} declares no state (rtcf::State) to reset", name));
    }
    Transactions::Change change;
    change.graph = plan_->graph;
    const bool running = loop_.inRealTime();
    change.copies = planReset(component, running);
    if (change.copies.empty()) {
        throw Error(ErrorKind::FailedPrecondition,
                    fmt::format("all state of {0} is live (rtcf::Live), and the loop of {1} runs: "
                                "stop it to reset {0}: rtcfctl -r {1} stop",
                                name, runner_));
    }
    boundary_.requireSmall(bytesOf(change.copies), "the reset");
    transactions_.adopt(std::move(change), [](const std::string&) {});
    return outcomeWith(*plan_, name);
}

// Only while the loop does not run: outside changes of state must not disturb a running loop.
ChangeOutcome ValueChanges::setStates(
    const std::string& name, const std::vector<std::pair<std::string, ParameterValue>>& batch) {
    control_.noticeEnd();
    const auto& states = accessTo(plan_->graph.get(name).instance->component()).states();
    if (loop_.joinable()) {
        throw Error(ErrorKind::FailedPrecondition,
                    fmt::format("the loop of {0} runs: stop it to set state: rtcfctl -r "
                                "{0} stop",
                                runner_));
    }
    std::vector<std::vector<std::byte>> values;
    Transactions::Change change;
    for (const auto& [state_name, value] : batch) {
        const auto found =
            std::find_if(states.begin(), states.end(),
                         [&](const StateDeclaration& state) { return state.name == state_name; });
        if (found == states.end()) {
            throw Error(ErrorKind::NotFound,
                        fmt::format("{} declares no state {}: rtcfctl info {} lists its states",
                                    name, state_name, name));
        }
        values.push_back(stateValue(name, *found, value));
        change.copies.push_back({found->value, values.back().data(), found->size});
    }
    change.graph = plan_->graph;
    transactions_.adopt(std::move(change), [](const std::string&) {});
    return outcomeWith(*plan_, name);
}

ChangeOutcome ValueChanges::setParameters(
    const std::string& name, const std::vector<std::pair<std::string, ParameterValue>>& batch) {
    Instance& instance = *plan_->graph.get(name).instance;
    const std::vector<ParameterValue> previous = instance.parameterValues();
    control_.noticeEnd();
    transactions_.requireNoReplay();
    // Only values change; the schedule stays.
    Adoption adoption;
    adoption.values = instance.stageParameters(batch);
    try {
        boundary_.adopt(adoption);
    } catch (...) {
        instance.restoreParameterValues(previous);
        throw;
    }
    // From here on, an error does not undo the change.
    instance.releaseStaged();
    ++plan_->schedule.generation;  // not used by the cycle
    logErrors(log_, "publishing a change", [&] {
        control_.publish({name});
        bridge_.setTable(*plan_, *publication_.graph());
        control_.noticeEnd();
    });
    return outcomeWith(*plan_, name);
}

WritableInput ValueChanges::writableInput(const std::string& name, const std::string& port) const {
    const InputPort& input = plan_->graph.get(name).instance->requireInput(port);
    const std::string full = fmt::format("{}.{}", name, port);
    for (const auto& [topic, connection] : plan_->wiring.connections) {
        const bool found =
            std::any_of(connection.readers.begin(), connection.readers.end(),
                        [&input](const Reader& reader) { return reader.input == &input; });
        if (!found) continue;
        if (connection.writer) {
            const Writer& writer = *connection.writer;
            throw Error(ErrorKind::TwoWriters,
                        fmt::format("{} reads {}.{}: write to an input that no component feeds",
                                    full, plan_->graph.nodes()[writer.node].instance->fullName(),
                                    writer.output->name()));
        }
        const auto injector = plan_->injectors.find(topic);
        if (injector != plan_->injectors.end() && bridge_.feeds(*injector->second)) {
            throw Error(ErrorKind::TwoWriters,
                        fmt::format("{0} reads the ROS topic {1}: publish there (rostopic pub "
                                    "{1}), or keep the topic out: rtcfctl runner set --blacklist",
                                    full, topic));
        }
        if (*input.type().ros_type == '\0') {
            throw Error(ErrorKind::InvalidArgument,
                        fmt::format("{} is of type {}, which has no text form: write to an input "
                                    "of a number, bool, string, Eigen type or ROS message",
                                    full, input.type().name));
        }
        return {topic, &input.type()};
    }
    throw Error(ErrorKind::PortNotFound, fmt::format("{} has no connection", full));
}

ChangeOutcome ValueChanges::writeInput(const std::string& name, const std::string& port,
                                       const std::string& message) {
    control_.noticeEnd();
    transactions_.requireNoReplay();
    const auto [topic, type] = writableInput(name, port);
    const auto* const bytes = reinterpret_cast<const std::uint8_t*>(message.data());
    const auto size = static_cast<std::uint32_t>(message.size());
    // Validates before any change.
    if (!type->deserialize(*type->make_slot(nullptr), bytes, size)) {
        throw Error(
            ErrorKind::InvalidArgument,
            fmt::format("{}.{} is of type {}: the value has another size", name, port, type->name));
    }
    if (plan_->injectors.count(topic) == 0) transactions_.makeWritable(topic);
    if (!plan_->injectors.at(topic)->deliver(bytes, size)) {
        throw Error(ErrorKind::InvalidArgument,
                    fmt::format("{}.{}: a value of {} bytes is too large: rtcfctl runner set "
                                "--largest-message",
                                name, port, size));
    }
    return outcomeWith(*plan_, name);
}

}  // namespace rtcf::executor
