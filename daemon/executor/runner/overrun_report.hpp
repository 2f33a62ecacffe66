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
    /// summary is less than ten seconds old and `last` is false. Not real-time.
    std::string take(const Loop& loop, const Graph& graph, bool last);

   private:
    std::string mostFrequentCause(const LoopStatistics& statistics, const Graph& graph);

    std::int64_t told_at_ns_ = 0;
    std::uint64_t told_overruns_ = 0;
    std::uint64_t told_missed_ = 0;
    std::uint64_t told_late_ = 0;
    std::uint64_t told_exchanges_ = 0;
    std::uint64_t told_frames_ = 0;
    std::map<std::shared_ptr<const ComponentStatistics>, std::uint64_t> told_of_;
};

}  // namespace rtcf::executor
