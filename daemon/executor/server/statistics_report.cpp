#include "server/statistics_report.hpp"

#include <utility>

namespace rtcf::executor {

namespace pb = ::rtcf::v1;

namespace {

void setDistribution(pb::Distribution& message, const DistributionSummary& summary) {
    message.set_count(summary.count);
    message.set_min_ns(summary.min);
    message.set_mean_ns(summary.mean);
    message.set_p50_ns(summary.p50);
    message.set_p99_ns(summary.p99);
    message.set_p999_ns(summary.p999);
    message.set_max_ns(summary.max);
}

void addBuckets(google::protobuf::RepeatedPtrField<pb::Bucket>& buckets,
                const HistogramSnapshot& snapshot, double scale) {
    for (const auto& [number, count] : snapshot.buckets) {
        pb::Bucket& bucket = *buckets.Add();
        const std::int64_t last = Histogram::lowerBound(number) + Histogram::width(number) - 1;
        bucket.set_upper_ns(static_cast<double>(last) * scale);
        bucket.set_count(count);
    }
}

}  // namespace

void StatisticsReport::addTo(pb::RunnerStatus& status, const GraphView& graph) const {
    const LoopStatistics& loop = runner_.loop().statistics();
    const std::shared_ptr<const Counted> baseline = this->baseline();
    status.set_iteration(loop.iteration.load(std::memory_order_relaxed));
    status.set_overruns(loop.overruns.load(std::memory_order_relaxed) - baseline->overruns);
    status.set_missed(loop.missed.load(std::memory_order_relaxed) - baseline->missed);
    status.set_log_dropped(log_.dropped() - baseline->log_dropped);
    status.set_tap_dropped(tapDropped(graph, *baseline));
}

// All statistics are of the same cycles, unless the loop leaves no time between cycles.
pb::RunnerStatistics StatisticsReport::statistics(bool buckets) const {
    const std::shared_ptr<const GraphView> graph = runner_.graph();
    const Loop& loop = runner_.loop();
    const double ns_per_tick = loop.counter().nsPerTick();
    const std::shared_ptr<const Counted> baseline = this->baseline();
    Counted now;
    if (!loop.statistics().counting.read([&] { now = counted(*graph); })) now = counted(*graph);
    pb::RunnerStatistics message;
    message.set_runner(runner_.name());
    const HistogramSnapshot duration = difference(now.duration, baseline->duration);
    message.set_iterations(duration.count);
    const HistogramSnapshot latency = difference(now.latency, baseline->latency);
    setDistribution(*message.mutable_duration(), summarize(duration, ns_per_tick));
    setDistribution(*message.mutable_latency(), summarize(latency, 1.0));
    setDistribution(*message.mutable_adoption(),
                    summarize(difference(now.adoption, baseline->adoption), ns_per_tick));
    if (buckets) {
        addBuckets(*message.mutable_duration_buckets(), duration, ns_per_tick);
        addBuckets(*message.mutable_latency_buckets(), latency, 1.0);
    }
    message.set_overruns(now.overruns - baseline->overruns);
    message.set_missed(now.missed - baseline->missed);
    message.set_late_wake_ups(now.late_wake_ups - baseline->late_wake_ups);
    message.set_exchange_overruns(now.exchange_overruns - baseline->exchange_overruns);
    message.set_frame_overruns(now.frame_overruns - baseline->frame_overruns);
    message.set_catching_up(now.catching_up - baseline->catching_up);
    for (const auto& component : graph->components) {
        pb::ComponentStatistics& statistics = *message.add_components();
        statistics.set_component(component->full_name);
        Counted::Component& present = now.components[component->statistics];
        if (const auto found = baseline->components.find(component->statistics);
            found != baseline->components.end()) {
            const Counted::Component& past = found->second;
            present.duration = difference(present.duration, past.duration);
            present.overruns -= past.overruns;
            present.device_calls -= past.device_calls;
            present.device_time_ns -= past.device_time_ns;
        }
        setDistribution(*statistics.mutable_duration(), summarize(present.duration, ns_per_tick));
        statistics.set_overruns(present.overruns);
        statistics.set_faults(component->statistics->faults.count.value());
        statistics.set_device_calls(present.device_calls);
        if (present.device_calls != 0) {
            statistics.set_device_mean_ns(static_cast<double>(present.device_time_ns) /
                                          static_cast<double>(present.device_calls));
        }
    }
    // The kernel's counters begin with each thread.
    const ThreadUsage before = now.thread == baseline->thread ? baseline->usage : ThreadUsage{};
    message.set_minor_faults(now.usage.minor_faults - before.minor_faults);
    message.set_major_faults(now.usage.major_faults - before.major_faults);
    message.set_involuntary_switches(now.usage.involuntary_switches - before.involuntary_switches);
    message.set_log_dropped(now.log_dropped - baseline->log_dropped);
    message.set_tap_dropped(tapDropped(*graph, *baseline));
    return message;
}

std::uint64_t StatisticsReport::tapDropped(const GraphView& graph, const Counted& baseline) {
    std::uint64_t dropped = 0;
    for (const auto& tap : graph.taps) {
        const auto found = baseline.tap_dropped.find(tap);
        dropped += tap->dropped() - (found == baseline.tap_dropped.end() ? 0 : found->second);
    }
    return dropped;
}

StatisticsReport::Counted StatisticsReport::counted(const GraphView& graph) const {
    const auto relaxed = std::memory_order_relaxed;
    const LoopStatistics& loop = runner_.loop().statistics();
    Counted totals;
    for (const auto& component : graph.components) {
        const ComponentStatistics& each = *component->statistics;
        totals.components[component->statistics] = {
            each.duration.snapshot(), each.overruns.load(relaxed), each.device.calls.load(relaxed),
            each.device.time_ns.load(relaxed)};
    }
    totals.duration = loop.duration.snapshot();
    totals.latency = loop.latency.snapshot();
    totals.adoption = loop.adoption.snapshot();
    totals.overruns = loop.overruns.load(relaxed);
    totals.missed = loop.missed.load(relaxed);
    totals.late_wake_ups = loop.late_wake_ups.value();
    totals.exchange_overruns = loop.exchange_overruns.value();
    totals.frame_overruns = loop.frame_overruns.value();
    totals.catching_up = loop.catching_up.value();
    totals.log_dropped = log_.dropped();
    for (const auto& tap : graph.taps) totals.tap_dropped[tap] = tap->dropped();
    totals.thread = runner_.loop().threadId();
    totals.usage = readThreadUsage(totals.thread);
    return totals;
}

// @return false if a cycle is being counted
bool StatisticsReport::restart() {
    runner_.holdStatistics(true);
    const std::shared_ptr<const GraphView> graph = runner_.graph();
    Counted now;
    if (!runner_.loop().statistics().counting.read([&] { now = counted(*graph); })) return false;
    setBaseline(std::move(now));
    return true;
}

void StatisticsReport::setBaseline(Counted totals) {
    {
        const auto next = std::make_shared<const Counted>(std::move(totals));
        const std::lock_guard<std::mutex> lock(mutex_);
        baseline_ = next;
    }
    runner_.holdStatistics(false);
}

std::shared_ptr<const StatisticsReport::Counted> StatisticsReport::baseline() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return baseline_;
}

void StatisticsReport::restartInStep() { setBaseline(counted(*runner_.graph())); }

}  // namespace rtcf::executor
