/// @file
/// Statistics of a runner since the last reset, as messages.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>

#include "logging/log.hpp"
#include "rtcf/executor/v1/executor.pb.h"
#include "runner/runner.hpp"
#include "statistics/histogram.hpp"
#include "statistics/thread_usage.hpp"

namespace rtcf::executor {

/// Owned by the server. Main thread and graph thread.
class StatisticsReport {
   public:
    /// @param runner, log outlive this object
    StatisticsReport(Runner& runner, Log& log) : runner_(runner), log_(log) {}

    /// Adds the statistics of a status.
    void addTo(::rtcf::v1::RunnerStatus& status, const GraphView& graph) const;
    /// All statistics.
    /// @param buckets true = with the histograms of the loop
    ::rtcf::v1::RunnerStatistics statistics(bool buckets) const;

    /// Resets the statistics.
    /// @return false if a cycle is being counted; later cycles are then not counted until a call
    /// succeeds
    bool restart();
    /// Resets the statistics, even while a cycle is being counted.
    void restartInStep();

   private:
    struct Counted {  // all counters since the start
        struct Component {
            HistogramSnapshot duration;
            std::uint64_t overruns = 0;
            std::uint64_t device_calls = 0;
            std::int64_t device_time_ns = 0;
        };
        // Shared ownership, as other statistics could get the same address.
        std::map<std::shared_ptr<const ComponentStatistics>, Component> components;
        HistogramSnapshot duration;
        HistogramSnapshot latency;
        HistogramSnapshot adoption;
        std::uint64_t overruns = 0;
        std::uint64_t missed = 0;
        std::uint64_t late_wake_ups = 0;
        std::uint64_t exchange_overruns = 0;
        std::uint64_t frame_overruns = 0;
        std::uint64_t catching_up = 0;
        std::uint64_t log_dropped = 0;
        // Weak, as the taps' rings are large.
        std::map<std::weak_ptr<const Tap>, std::uint64_t, std::owner_less<>> tap_dropped;
        int thread = 0;
        ThreadUsage usage;
    };

    Counted counted(const GraphView& graph) const;
    static std::uint64_t tapDropped(const GraphView& graph, const Counted& baseline);
    void setBaseline(Counted totals);
    std::shared_ptr<const Counted> baseline() const;

    Runner& runner_;
    Log& log_;
    mutable std::mutex mutex_;  // the graph thread makes status messages, too
    std::shared_ptr<const Counted> baseline_ = std::make_shared<Counted>();
};

}  // namespace rtcf::executor
