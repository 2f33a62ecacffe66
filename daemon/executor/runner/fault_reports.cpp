#include "runner/fault_reports.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>

#include "common/time_units.hpp"
#include "common/utf8.hpp"

namespace rtcf::executor {

namespace {

// The text of a fault. The cycle cuts a copied text at the size of its array.
std::string textOf(const char* text, std::size_t array_size) {
    const std::string_view whole(text);
    return std::string(whole.size() < array_size - 1 ? whole : wholeCharacters(whole));
}

std::string whatFailed(const LoopFault& fault) {
    const std::string text = textOf(fault.text.data(), fault.text.size());
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

FaultReports::FaultReports(const std::string& runner, const Loop& loop, Log& log,
                           ReportEvent report_event, PublishFault publish)
    : loop_(loop),
      report_event_(std::move(report_event)),
      publish_(std::move(publish)),
      sizes_(runner, [&log](const std::string& line) { log.write(LogLevel::Warn, {}, line); }) {}

RunnerEvent FaultReports::endOfLoop(const Graph& graph, std::uint32_t max_overruns) const {
    const LoopFault& fault = loop_.fault();
    RunnerEvent event{RunnerEvent::Kind::LoopEnded, {}, {}, fault.iteration};
    if (fault.kind == LoopFault::Kind::Overruns) {
        event.message = fmt::format("loop stopped in iteration {}: more than {} overruns",
                                    fault.iteration, max_overruns);
    }
    if (fault.component == nullptr) return event;
    event.component = fault.component_name.data();
    const std::string what = whatFailed(fault);
    event.message =
        fmt::format("loop stopped in iteration {}: {}: {}", fault.iteration, event.component, what);
    const auto node = std::find_if(
        graph.nodes().begin(), graph.nodes().end(),
        [&](const GraphNode& each) { return &each.instance->component() == fault.component; });
    // The component may have been unloaded at the boundary at which the loop ended.
    if (node != graph.nodes().end())
        node->instance->setFault(fmt::format("iteration {}: {}", fault.iteration, what));
    return event;
}

void FaultReports::reportComponents(const Graph& graph) {
    recurring_.rearm(monotonicNow());
    for (const GraphNode& node : graph.nodes()) report(*node.instance);
}

void FaultReports::report(Instance& instance) {
    ComponentFaults& faults = instance.statistics()->faults;
    const auto say = [&](const ComponentFault* fault, const char* text, std::uint64_t more) {
        if (fault == nullptr) return;
        const std::string of = textOf(fault->text, FirstFault::kTextSize);
        std::string what = fmt::vformat(text, fmt::make_format_args(of));
        if (more > 1) what += fmt::format("; {} times since the last report", more);
        instance.setFault(fmt::format("iteration {}: {}", fault->iteration, what));
        report_event_(
            {RunnerEvent::Kind::ComponentFailed,
             fmt::format("{}: iteration {}: {}", instance.fullName(), fault->iteration, what),
             instance.fullName(), fault->iteration});
        publish_(instance.fullName());
    };
    const ComponentFault* const reported = faults.reported.take();
    const ComponentFault* const not_finite = faults.not_finite.take();
    if (reported != nullptr || not_finite != nullptr) {
        const std::uint64_t more = recurring_.noteReport(instance.statistics(), monotonicNow());
        say(not_finite, "output {} is not finite: readers keep its last value", more);
        say(reported, "{}", more);
    }
    say(faults.taken_out.take(), "update() threw: {}; taken out, the loop goes on", 0);
    say(faults.unsafe.take(), "cannot copy a value of safe(): {}; readers keep the value before",
        0);
}

void FaultReports::reportOverruns(const Graph& graph, bool last, const char* remark) {
    std::string line = overruns_.take(loop_, graph, last);
    if (line.empty()) return;
    report_event_(
        {RunnerEvent::Kind::Overruns, line + remark, {}, loop_.statistics().iteration.load()});
}

void FaultReports::reportLostMessages(const Plan& plan, std::size_t largest) {
    const std::int64_t now = monotonicNow();
    if (now < sizes_due_ns_) return;
    sizes_due_ns_ = now + kSecond / 2;
    sizes_.look(plan.serialized_taps, plan.injectors, largest, now);
}

}  // namespace rtcf::executor
