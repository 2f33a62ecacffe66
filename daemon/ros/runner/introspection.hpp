/// @file
/// What ROS peers see of a runner besides its ports: every cycle on
/// `<namespace>/cycles` and `iteration_info`, its health on `/diagnostics`, and services.
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

/// Owned by the ROS node; all but the constructor and the destructor by the watch thread. The
/// health has a thread of its own: once a second, and at once when the loop's state changes, as the
/// node may be about to go.
class Introspection {
   public:
    /// @param log gets why services refused; outlives this
    Introspection(executor::RunnerView& runner, const executor::AskSupervisor& ask,
                  executor::Log& log);

    /// Opens what is not open yet, in this namespace and no other. Watch thread.
    /// @param node   full name of the node: what the health is reported of
    /// @param serves whether there are services; what the callers may do the supervisor decides
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
    void tell();      // under the lock, with a topic
    void tellLast();  // the state that the node goes with

    executor::RunnerView& runner_;
    CycleTopic cycles_;
    RunnerServices services_;
    std::string name_space_;
    bool serves_ = false;
    bool open_ = false;
    std::atomic<bool> stop_{false};
    std::mutex mutex_;  // all down to report_
    ros::Publisher diagnostics_;
    Departures departures_{false};
    std::optional<executor::RunnerState> told_;
    DiagnosticReport report_;
    std::thread health_;
};

}  // namespace rtcf::ros1
