/// @file
/// Summarises late cycles, so that a loop that is always late logs one line every ten seconds.
/// Owned by FaultReports; graph thread.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>

#include "graph/graph.hpp"
#include "loop/loop.hpp"

namespace rtcf::executor {

class OverrunReport {
   public:
    /// The summary since the last one, in one line. Empty if no cycle was late, or if the last
    /// summary is less than ten seconds old, unless `last` is true or an overload has begun. Not
    /// real-time.
    std::string take(const Loop& loop, const Graph& graph, bool last);

   private:
    std::string mostFrequentCause(const LoopStatistics& statistics, const Graph& graph);

    std::int64_t reported_at_ns_ = 0;
    std::uint64_t reported_overruns_ = 0;
    std::uint64_t reported_missed_ = 0;
    std::uint64_t reported_rests_ = 0;
    bool reported_overload_ = false;  // in the last line
    std::uint64_t reported_late_ = 0;
    std::uint64_t reported_exchanges_ = 0;
    std::uint64_t reported_frames_ = 0;
    std::map<std::shared_ptr<const ComponentStatistics>, std::uint64_t> reported_of_component_;
};

}  // namespace rtcf::executor
