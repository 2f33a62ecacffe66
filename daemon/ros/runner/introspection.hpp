/// @file
/// What ROS peers see of a runner besides its ports: every cycle on
/// `<namespace>/cycles` and `iteration_info`, its health on `/diagnostics`, and services.
#pragma once

#include <ros/publisher.h>

#include <chrono>
#include <string>

#include "bridge/outside_call.hpp"
#include "ros/runner/cycle_topic.hpp"
#include "ros/runner/runner_report.hpp"
#include "ros/runner/runner_services.hpp"

namespace rtcf::ros1 {

/// Owned by the ROS node; all but the constructor and the destructor by the watch thread.
class Introspection {
   public:
    /// @param log gets why services refused; outlives this
    Introspection(executor::RunnerView& runner, const executor::AskSupervisor& ask,
                  executor::Log& log);

    /// Opens what is not open yet, in this namespace and no other. With a master.
    void open(ros::NodeHandle& handle, const std::string& name_space);
    void close();
    bool isOpen() const { return open_; }

    /// Publishes the diagnostics when they are due: once a second.
    void publishDiagnostics();

   private:
    CycleTopic cycles_;
    DiagnosticReport report_;
    RunnerServices services_;
    ros::Publisher diagnostics_;
    std::chrono::steady_clock::time_point due_;
    std::string name_space_;
    bool open_ = false;
};

}  // namespace rtcf::ros1
