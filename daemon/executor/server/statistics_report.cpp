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

void setDevice(pb::ComponentStatistics& message, const ComponentStatistics& of) {
    const auto since = [](const auto& now, const auto& before) {
        return now.load(std::memory_order_relaxed) - before.load(std::memory_order_relaxed);
    };
    const std::uint64_t calls = since(of.device.calls, of.device_before.calls);
    message.set_device_calls(calls);
    if (calls == 0) return;
    const std::int64_t time_ns = since(of.device.time_ns, of.device_before.time_ns);
    message.set_device_mean_ns(static_cast<double>(time_ns) / static_cast<double>(calls));
}

}  // namespace

void StatisticsReport::addTo(pb::RunnerStatus& status, const GraphView& graph) const {
    const LoopStatistics& loop = runner_.loop().statistics();
    const std::shared_ptr<const Baseline> baseline = this->baseline();
    status.set_iteration(loop.iteration.load(std::memory_order_relaxed));
    status.set_overruns(loop.overruns.recent());
    status.set_missed(loop.missed.recent());
    status.set_log_dropped(log_.dropped() - baseline->log_dropped);
    status.set_tap_dropped(tapDropped(graph, *baseline));
}

pb::RunnerStatistics StatisticsReport::statistics(bool buckets) const {
    const std::shared_ptr<const GraphView> graph = runner_.graph();
    const LoopStatistics& loop = runner_.loop().statistics();
    const double ns_per_tick = runner_.loop().counter().nsPerTick();
    const std::shared_ptr<const Baseline> baseline = this->baseline();
    CycleStatistics& cycles = runner_.cycleStatistics();
    pb::RunnerStatistics message;
    message.set_runner(runner_.name());
    for (const auto& component : graph->components)
        message.add_components()->set_component(component->full_name);
    const auto counters = [&] {
        message.set_overruns(loop.overruns.recent());
        message.set_missed(loop.missed.recent());
        message.set_late_wake_ups(loop.late_wake_ups.recent());
        message.set_exchange_overruns(loop.exchange_overruns.recent());
        message.set_frame_overruns(loop.frame_overruns.recent());
        message.set_catching_up(loop.catching_up.recent());
        for (std::size_t i = 0; i < graph->components.size(); ++i) {
            message.mutable_components(static_cast<int>(i))
                ->set_overruns(graph->components[i]->statistics->overruns.recent());
        }
    };
    const auto histograms = [&] {
        const HistogramSnapshot duration = cycles.duration().snapshot();
        const HistogramSnapshot latency = cycles.latency().snapshot();
        message.set_iterations(duration.count);
        message.set_uncounted(cycles.lost());
        setDistribution(*message.mutable_duration(), summarize(duration, ns_per_tick));
        setDistribution(*message.mutable_latency(), summarize(latency, 1.0));
        if (buckets) {
            addBuckets(*message.mutable_duration_buckets(), duration, ns_per_tick);
            addBuckets(*message.mutable_latency_buckets(), latency, 1.0);
        }
        for (std::size_t i = 0; i < graph->components.size(); ++i) {
            const Histogram& of = graph->components[i]->statistics->duration;
            setDistribution(*message.mutable_components(static_cast<int>(i))->mutable_duration(),
                            summarize(of.snapshot(), ns_per_tick));
        }
    };
    cycles.read(counters, histograms);
    for (std::size_t i = 0; i < graph->components.size(); ++i) {
        const ComponentStatistics& of = *graph->components[i]->statistics;
        pb::ComponentStatistics& statistics = *message.mutable_components(static_cast<int>(i));
        statistics.set_faults(of.faults.count.value());
        setDevice(statistics, of);
    }
    setDistribution(
        *message.mutable_adoption(),
        summarize(difference(loop.adoption.snapshot(), baseline->adoption), ns_per_tick));
    // The kernel's counters begin with each thread.
    const int thread = runner_.loop().threadId();
    const ThreadUsage usage = readThreadUsage(thread);
    const ThreadUsage before = thread == baseline->thread ? baseline->usage : ThreadUsage{};
    message.set_minor_faults(usage.minor_faults - before.minor_faults);
    message.set_major_faults(usage.major_faults - before.major_faults);
    message.set_involuntary_switches(usage.involuntary_switches - before.involuntary_switches);
    message.set_log_dropped(log_.dropped() - baseline->log_dropped);
    message.set_tap_dropped(tapDropped(*graph, *baseline));
    return message;
}

std::uint64_t StatisticsReport::tapDropped(const GraphView& graph, const Baseline& baseline) {
    std::uint64_t dropped = 0;
    for (const auto& tap : graph.taps) {
        const auto found = baseline.tap_dropped.find(tap);
        dropped += tap->dropped() - (found == baseline.tap_dropped.end() ? 0 : found->second);
    }
    return dropped;
}

void StatisticsReport::restart() {
    const std::shared_ptr<const GraphView> graph = runner_.graph();
    runner_.cycleStatistics().restart();
    Baseline now;
    now.adoption = runner_.loop().statistics().adoption.snapshot();
    now.log_dropped = log_.dropped();
    for (const auto& tap : graph->taps) now.tap_dropped[tap] = tap->dropped();
    now.thread = runner_.loop().threadId();
    now.usage = readThreadUsage(now.thread);
    const auto next = std::make_shared<const Baseline>(std::move(now));
    const std::lock_guard<std::mutex> lock(mutex_);
    baseline_ = next;
}

std::shared_ptr<const StatisticsReport::Baseline> StatisticsReport::baseline() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return baseline_;
}

}  // namespace rtcf::executor
