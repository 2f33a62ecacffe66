#include "runner/overrun_report.hpp"

#include <fmt/format.h>

#include <utility>

namespace rtcf::executor {

namespace {

constexpr std::int64_t kInterval = 10'000'000'000;

std::string cycles(std::uint64_t count) {
    return count == 1 ? "1 cycle" : fmt::format("{} cycles", count);
}

}  // namespace

std::string OverrunReport::take(const Loop& loop, const Graph& graph, bool last) {
    const LoopStatistics& statistics = loop.statistics();
    const std::uint64_t overruns = statistics.overruns.value();
    const std::uint64_t missed = statistics.missed.value();
    const std::int64_t now = monotonicNow();
    if (overruns == reported_overruns_) return {};
    const std::uint64_t rests = loop.rests();
    const bool overloaded = rests != reported_rests_;
    const bool news = last || reported_at_ns_ == 0 || (overloaded && !reported_overload_);
    if (!news && now - reported_at_ns_ < kInterval) return {};
    std::string line = fmt::format("{} ended late", cycles(overruns - reported_overruns_));
    if (missed != reported_missed_)
        line += fmt::format(", {} missed", cycles(missed - reported_missed_));
    if (reported_at_ns_ != 0)
        line += fmt::format(" in {:.0f} s", static_cast<double>(now - reported_at_ns_) / 1e9);
    line += mostFrequentCause(statistics, graph);
    if (overloaded)
        line +=
            "; the loop is overloaded, and leaves a quarter of the CPU to others: take components "
            "out, or lower its frequency";
    reported_at_ns_ = now;
    reported_overruns_ = overruns;
    reported_missed_ = missed;
    reported_rests_ = rests;
    reported_overload_ = overloaded;
    return line;
}

// The most frequent cause of overruns since the last line: a component, or a cause outside of
// components.
std::string OverrunReport::mostFrequentCause(const LoopStatistics& statistics, const Graph& graph) {
    std::map<std::shared_ptr<const ComponentStatistics>, std::uint64_t> present;
    std::string text;
    std::uint64_t most = 0;
    const auto consider = [&](std::uint64_t count, const std::string& cause) {
        if (count <= most) return;
        most = count;
        text = cause;
    };
    for (const GraphNode& node : graph.nodes()) {
        const std::shared_ptr<const ComponentStatistics> counted = node.instance->statistics();
        const std::uint64_t count = counted->overruns.value();
        const auto reported = reported_of_component_.find(counted);
        present.emplace(counted, count);
        consider(count - (reported == reported_of_component_.end() ? 0 : reported->second),
                 ", most of them in " + node.instance->fullName());
    }
    reported_of_component_ = std::move(present);
    const std::uint64_t late = statistics.late_wake_ups.value();
    const std::uint64_t exchanges = statistics.exchange_overruns.value();
    const std::uint64_t frames = statistics.frame_overruns.value();
    consider(late - std::exchange(reported_late_, late),
             ", most of them because the machine woke the loop late");
    consider(exchanges - std::exchange(reported_exchanges_, exchanges),
             ", most of them while changes or values were exchanged");
    consider(frames - std::exchange(reported_frames_, frames),
             ", most of them while values were copied into frames: lower frame_kb of the runner");
    return text;
}

}  // namespace rtcf::executor
