/// @file
/// A runner as ROS messages: its graph for services, its health for `/diagnostics`. Pure functions
/// of the runner's view.
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
struct ComponentStatistics;
class RunnerView;
}  // namespace rtcf::executor

namespace rtcf::ros1 {

/// The whole graph and the runner's state.
rtcf_msgs::GetLoop::Response describeRunner(const executor::RunnerView& runner);

/// The part of it that RTCF 2021 reports, in its format.
rtcf_msgs::RunnerInfo runnerInfo(const rtcf_msgs::GetLoop::Response& loop);

/// The runner's health and its statistics since the last report.
class DiagnosticReport {
   public:
    /// @param hardware name of the machine
    DiagnosticReport(executor::RunnerView& runner, std::string hardware);

    /// Sets the prefix of status names, which must be unique on /diagnostics.
    void nameAfter(const std::string& node) { name_ = node.substr(node.find_first_not_of('/')); }

    /// Makes one status for the loop and one for each component; without a stamp.
    diagnostic_msgs::DiagnosticArray take();

   private:
    using Statistics = std::shared_ptr<const executor::ComponentStatistics>;
    struct Counts {  // counts at the last report
        executor::HistogramSnapshot duration;
        std::uint64_t overruns = 0;
    };

    diagnostic_msgs::DiagnosticStatus loopStatus();
    static diagnostic_msgs::DiagnosticStatus componentStatus(
        const std::string& name, const std::string& fault, const executor::ComponentStatistics& now,
        double ns_per_tick, Counts& last);
    /// @return growth of a counter, which restarts from 0 with the loop
    static std::uint64_t growth(std::uint64_t now, std::uint64_t& last);

    executor::RunnerView& runner_;
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
    std::vector<std::string> degraded_;  // as last reported
    std::map<Statistics, Counts> components_;
};

}  // namespace rtcf::ros1
