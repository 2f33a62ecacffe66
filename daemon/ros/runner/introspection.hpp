/// @file
/// The ROS interface of a runner besides its ports: every cycle on `<namespace>/cycles` and
/// `iteration_info`, its health on `/diagnostics`, and services.
#pragma once

#include <ros/publisher.h>

#include <atomic>
#include <chrono>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "bridge/outside_call.hpp"
#include "ros/runner/cycle_topic.hpp"
#include "ros/runner/runner_report.hpp"
#include "ros/runner/runner_services.hpp"
#include "ros/transport/raw_message.hpp"

namespace rtcf::executor {
enum class RunnerState;
}

namespace rtcf::ros1 {

/// Owned by RosInterface; watch thread. A separate thread reports the health once a second, and at
/// once when the loop's state changes, because the node may be about to end.
class Introspection {
   public:
    /// @param log receives the reasons of failed service calls; outlives this object
    Introspection(executor::RunnerView& runner, const executor::AskSupervisor& ask,
                  executor::Log& log);

    /// Opens topics and services in this namespace; closes those in another one. Watch thread.
    /// @param node   full name of the node, for the names of diagnostics
    /// @param serves true = offer services; rtcfd checks the rights of callers
    void open(ros::NodeHandle& handle, const std::string& node, const std::string& name_space,
              bool serves);
    void close();
    bool isOpen() const { return open_; }
    ~Introspection();
    Introspection(const Introspection&) = delete;
    Introspection& operator=(const Introspection&) = delete;

   private:
    using Clock = std::chrono::steady_clock;

    void watchHealth();
    void publishHealth();      // with mutex_ held and the topic open
    void publishLastHealth();  // publishes the last state

    executor::RunnerView& runner_;
    CycleTopic cycles_;
    RunnerServices services_;
    std::string name_space_;
    bool serves_ = false;
    bool open_ = false;
    std::atomic<bool> stop_{false};
    std::mutex mutex_;  // protects diagnostics_ to report_
    ros::Publisher diagnostics_;
    Departures departures_{false};
    std::optional<executor::RunnerState> published_;
    DiagnosticReport report_;
    std::thread health_;
};

}  // namespace rtcf::ros1
