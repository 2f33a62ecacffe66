// Runner: unsolicited reports on faults, overruns and lost messages.
#include <fmt/format.h>

#include "common/refusal.hpp"
#include "common/time_units.hpp"
#include "runner/runner.hpp"

namespace rtcf::executor {

namespace {

std::string whatFailed(const LoopFault& fault) {
    const char* const text = fault.text.data();
    switch (fault.kind) {
        case LoopFault::Kind::NotFinite:
            return fmt::format("output {} is not finite", text);
        case LoopFault::Kind::NoMemory:
            return fmt::format("no memory to copy the value of {}; reserve() the largest one",
                               text);
        default:
            return fmt::format("update() threw: {}", text);
    }
}

}  // namespace

const GraphNode* Runner::nodeOf(const Component* component) const noexcept {
    for (const GraphNode& node : plan_->graph.nodes()) {
        if (&node.instance->component() == component) return &node;
    }
    return nullptr;
}

void Runner::noteLoopFault() {
    const LoopFault& fault = loop_.fault();
    setState(fault.kind == LoopFault::Kind::None ? RunnerState::Stopped : RunnerState::Faulted);
    if (state_ == RunnerState::Faulted) {
        RunnerEvent event{RunnerEvent::Kind::LoopEnded, {}, {}, fault.iteration};
        if (fault.kind == LoopFault::Kind::Overruns) {
            event.message = fmt::format("loop stopped in iteration {}: more than {} overruns",
                                        fault.iteration, settings_.loop.max_overruns);
        }
        if (fault.component != nullptr) {
            event.component = fault.component_name.data();
            const std::string what = whatFailed(fault);
            event.message = fmt::format("loop stopped in iteration {}: {}: {}", fault.iteration,
                                        event.component, what);
            // The component may have been unloaded at the boundary at which the loop ended.
            if (const GraphNode* node = nodeOf(fault.component); node != nullptr) {
                node->instance->setFault(fmt::format("iteration {}: {}", fault.iteration, what));
            }
        }
        status_ = event.message;
        tell(event);
    }
}

// Reports component faults that did not end the loop. A component is taken out once; values that
// are not finite are reported again after a while.
void Runner::noteComponentFaults() {
    told_not_finite_.rearm(monotonicNow());
    const std::uint64_t count = loop_.figures().faults.value();
    if (std::exchange(told_faults_, count) == count) return;
    for (const GraphNode& node : plan_->graph.nodes()) noteFaultsOf(*node.instance);
}

void Runner::noteFaultsOf(Instance& instance) {
    ComponentFaults& faults = instance.figures()->faults;
    const auto say = [&](const ComponentFault* fault, const char* text, std::uint64_t more) {
        if (fault == nullptr) return;
        const char* of = fault->text.data();
        std::string what = fmt::vformat(text, fmt::make_format_args(of));
        if (more > 1) what += fmt::format("; {} times since the last report", more);
        instance.setFault(fmt::format("iteration {}: {}", fault->iteration, what));
        tell({RunnerEvent::Kind::ComponentFailed,
              fmt::format("{}: iteration {}: {}", instance.fullName(), fault->iteration, what),
              instance.fullName(), fault->iteration});
        publish({instance.fullName()});
    };
    if (const ComponentFault* fault = faults.not_finite.take(); fault != nullptr) {
        const std::uint64_t more = told_not_finite_.told(instance.figures(), monotonicNow());
        say(fault, "output {} is not finite: readers keep its last value", more);
    }
    say(faults.taken_out.take(), "update() threw: {}; taken out, the loop goes on", 0);
    say(faults.unsafe.take(), "cannot copy a value of safe(): {}; readers keep the value before",
        0);
}

void Runner::noteOverruns(bool last) {
    std::string line = overrun_report_.take(loop_, plan_->graph, last);
    if (line.empty()) return;
    if (!degraded_.empty() && settings_.loop.max_overruns != 0)
        line += "; max_overruns does not stop a degraded loop";
    tell({RunnerEvent::Kind::Overruns, std::move(line), {}, loop_.figures().iteration.load()});
}

void Runner::noteSizes() {
    const std::int64_t now = monotonicNow();
    if (now < sizes_due_ns_) return;
    sizes_due_ns_ = now + kSecond / 2;
    size_watch_.look(plan_->taps, plan_->injectors, settings_.bridge.largest_message, now);
}

}  // namespace rtcf::executor
