#include "runner/overrun_report.hpp"

#include <fmt/format.h>

namespace rtcf::executor {

namespace {

constexpr std::int64_t kInterval = 10'000'000'000;

std::string cycles(std::uint64_t count) {
    return count == 1 ? "1 cycle" : fmt::format("{} cycles", count);
}

}  // namespace

std::string OverrunReport::take(const Loop& loop, const Graph& graph, bool last) {
    const LoopFigures& figures = loop.figures();
    const std::uint64_t overruns = figures.overruns.load(std::memory_order_relaxed);
    const std::uint64_t missed = figures.missed.load(std::memory_order_relaxed);
    const std::int64_t now = monotonicNow();
    if (overruns == told_overruns_) return {};
    if (!last && told_at_ns_ != 0 && now - told_at_ns_ < kInterval) return {};
    std::string line = fmt::format("{} ended late", cycles(overruns - told_overruns_));
    if (missed != told_missed_) line += fmt::format(", {} missed", cycles(missed - told_missed_));
    if (told_at_ns_ != 0)
        line += fmt::format(" in {:.0f} s", static_cast<double>(now - told_at_ns_) / 1e9);
    if (const std::string name = latestComponent(graph); !name.empty())
        line += ", most of them in " + name;
    told_at_ns_ = now;
    told_overruns_ = overruns;
    told_missed_ = missed;
    return line;
}

// The component that was running most often since the last line, when a cycle should have ended.
std::string OverrunReport::latestComponent(const Graph& graph) {
    std::map<std::shared_ptr<const ComponentFigures>, std::uint64_t> present;
    std::string name;
    std::uint64_t most = 0;
    for (const GraphNode& node : graph.nodes()) {
        const std::shared_ptr<const ComponentFigures> figures = node.instance->figures();
        const std::uint64_t count = figures->overruns.load(std::memory_order_relaxed);
        const auto told = told_of_.find(figures);
        const std::uint64_t since = count - (told == told_of_.end() ? 0 : told->second);
        present.emplace(figures, count);
        if (since <= most) continue;
        most = since;
        name = node.instance->fullName();
    }
    told_of_ = std::move(present);
    return name;
}

}  // namespace rtcf::executor
