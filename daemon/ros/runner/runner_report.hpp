/// @file
/// A runner as ROS messages: its graph for those who ask, its health for
/// `/diagnostics`. Pure functions of what the runner shows.
#pragma once

#include <diagnostic_msgs/DiagnosticArray.h>
#include <rtcf_msgs/GetLoop.h>
#include <rtcf_msgs/RunnerInfo.h>

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "statistics/histogram.hpp"

namespace rtcf::executor {
struct ComponentFigures;
class RunnerView;
}  // namespace rtcf::executor

namespace rtcf::ros1 {

/// The whole graph, and what the runner does.
rtcf_msgs::GetLoop::Response describeRunner(const executor::RunnerView& runner);

/// The part of it that RTCF 2021 tells, as it tells it.
rtcf_msgs::RunnerInfo runnerInfo(const rtcf_msgs::GetLoop::Response& loop);

/// The runner's health, and what its figures were since the last report.
class DiagnosticReport {
   public:
    /// @param hardware names the machine
    DiagnosticReport(const executor::RunnerView& runner, std::string hardware);

    /// What statuses are named after: unique among all that report.
    void nameAfter(const std::string& node) { name_ = node.substr(node.find_first_not_of('/')); }

    /// One status for the loop, one for each component; without a stamp.
    diagnostic_msgs::DiagnosticArray take();

   private:
    using Figures = std::shared_ptr<const executor::ComponentFigures>;
    struct Counts {  // what was counted at the last report
        executor::HistogramSnapshot duration;
        std::uint64_t overruns = 0;
    };

    diagnostic_msgs::DiagnosticStatus loopStatus();
    static diagnostic_msgs::DiagnosticStatus componentStatus(const std::string& name,
                                                             const std::string& fault,
                                                             const executor::ComponentFigures& now,
                                                             double ns_per_tick, Counts& last);
    /// @return how much a counter has grown; it begins anew with the loop
    static std::uint64_t growth(std::uint64_t now, std::uint64_t& last);

    const executor::RunnerView& runner_;
    const std::string hardware_;
    std::string name_;
    executor::HistogramSnapshot duration_;
    executor::HistogramSnapshot latency_;
    std::uint64_t overruns_ = 0;
    std::uint64_t missed_ = 0;
    std::uint64_t dropped_ = 0;
    std::uint64_t iteration_ = 0;
    std::int64_t time_ns_ = 0;
    bool ran_ = false;                   // at the last report
    std::vector<std::string> degraded_;  // as it was said last
    std::map<Figures, Counts> components_;
};

}  // namespace rtcf::ros1
