/// @file
/// What a runner has counted since the last reset, as messages.
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

/// Owned by the server; its thread and the graph thread.
class Figures {
   public:
    /// @param runner, log outlive this
    Figures(Runner& runner, Log& log) : runner_(runner), log_(log) {}

    /// Those of a status.
    void addTo(::rtcf::v1::RunnerStatus& status, const GraphSnapshot& graph) const;
    /// @param buckets with how often the loop took how long
    ::rtcf::v1::RunnerStatistics statistics(bool buckets) const;

    /// Counts from now on. @return whether it could: not while a cycle is being counted; cycles
    /// after it are not, until it can
    bool restart();
    /// Counts from now on, also while a cycle is being counted.
    void restartInStep();

   private:
    struct Counted {  // all that is counted, since the beginning
        struct Component {
            HistogramSnapshot duration;
            std::uint64_t overruns = 0;
            std::uint64_t device_calls = 0;
            std::int64_t device_time_ns = 0;
        };
        // Held, as another component's figures could come to the same address.
        std::map<std::shared_ptr<const ComponentFigures>, Component> components;
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
        // Not held, as their rings are large.
        std::map<std::weak_ptr<const Tap>, std::uint64_t, std::owner_less<>> tap_dropped;
        int thread = 0;
        ThreadUsage usage;
    };

    Counted counted(const GraphSnapshot& graph) const;
    static std::uint64_t tapDropped(const GraphSnapshot& graph, const Counted& baseline);
    void setBaseline(Counted figures);
    std::shared_ptr<const Counted> baseline() const;

    Runner& runner_;
    Log& log_;
    mutable std::mutex mutex_;  // the graph thread tells a status, too
    std::shared_ptr<const Counted> baseline_ = std::make_shared<Counted>();
};

}  // namespace rtcf::executor
