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
    void restart();

   private:
    /// Totals at the last reset, for counters that it does not set to 0.
    struct Baseline {
        HistogramSnapshot adoption;
        std::uint64_t log_dropped = 0;
        // Weak, as the taps' rings are large.
        std::map<std::weak_ptr<const Tap>, std::uint64_t, std::owner_less<>> tap_dropped;
        int thread = 0;
        ThreadUsage usage;
    };

    static std::uint64_t tapDropped(const GraphView& graph, const Baseline& baseline);
    std::shared_ptr<const Baseline> baseline() const;

    Runner& runner_;
    Log& log_;
    mutable std::mutex mutex_;  // the graph thread makes status messages, too
    std::shared_ptr<const Baseline> baseline_ = std::make_shared<Baseline>();
};

}  // namespace rtcf::executor
