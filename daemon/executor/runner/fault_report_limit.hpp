/// @file
/// Rate limit of reports on values that are not finite, and of faults that components report: the
/// first fault of a component is reported at once, later ones after a silence, which doubles while
/// the faults continue. Owned by FaultReports; graph thread.
#pragma once

#include <cstdint>
#include <map>
#include <memory>

#include "loop/schedule.hpp"

namespace rtcf::executor {

class FaultReportLimit {
   public:
    /// Notes that a fault of a component was reported, and begins a silence.
    /// @param now_ns CLOCK_MONOTONIC, ns
    /// @return faults of this component since its last report; 0 = this is the first report
    std::uint64_t noteReport(const std::shared_ptr<ComponentStatistics>& of, std::int64_t now_ns);
    /// Enables the next report of components whose silence is over.
    void rearm(std::int64_t now_ns);

   private:
    struct Silence {
        std::int64_t until_ns = 0;
        std::int64_t length_ns = 0;
        std::uint64_t count = 0;  // number of the component's faults at the last report
        bool over = false;
    };
    std::map<std::shared_ptr<ComponentStatistics>, Silence> silences_;
};

}  // namespace rtcf::executor
