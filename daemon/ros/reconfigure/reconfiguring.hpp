/// @file
/// Parameters on ROS: a dynamic_reconfigure server for each component with parameters, and their
/// values on the parameter server.
#pragma once

#include <ros/callback_queue.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "bridge/bridge.hpp"
#include "ros/calls/master_client.hpp"
#include "ros/parameters/parameter_mirror.hpp"
#include "ros/reconfigure/reconfigure_server.hpp"

namespace ros {
class NodeHandle;
}

namespace rtcf::ros1 {

/// Owned by the master watch. A separate thread answers the services.
class Reconfiguring {
   public:
    using Sets = std::vector<std::shared_ptr<const executor::ParameterSet>>;

    /// @param warn receives warnings on values out of range; any thread
    explicit Reconfiguring(
        std::function<void(const std::string& component, const std::string& line)> warn);
    ~Reconfiguring();
    Reconfiguring(const Reconfiguring&) = delete;
    Reconfiguring& operator=(const Reconfiguring&) = delete;

    /// Sets the function that requests changes. Called first.
    void serve(executor::ParameterRequest request) {
        request_ = request;
        mirror_.serve(std::move(request));
    }
    /// Sets whether a call with a value out of range fails. Any thread.
    void refuseOutOfRange(bool refuse) noexcept { range_.refuse = refuse; }
    /// Sets the parameters to offer. Any thread; returns at once.
    void setSets(const Sets& sets);
    /// Fails pending calls, because requests get no more answers. Any thread.
    void end() noexcept { stop_ = true; }

    /// Opens and closes servers, and synchronises parameters. Watch thread, with a master.
    Reconciled reconcile(ros::NodeHandle& handle, ParallelCalls& master,
                         const ParameterMirror::Caller& caller);
    /// Sets whether peers may change parameters, or only read them. Watch thread.
    void allow(bool allowed);
    /// Notes that a parameter or a namespace has been written at the master. Any thread.
    void noteWritten(const std::string& key) { mirror_.noteWritten(key); }
    /// See ParameterMirror. Watch thread.
    std::vector<std::string> takeRejections() { return mirror_.takeRejections(); }
    /// Starts again with a new master. Watch thread.
    void forget();
    /// Closes everything; reconcile() opens it again. Watch thread.
    void closeAll(ParallelCalls& master, const ParameterMirror::Caller& caller,
                  std::chrono::steady_clock::time_point deadline);

    /// The error of a server; empty = none. Any thread.
    std::string problem() const;

   private:
    using Servers = std::map<std::string, std::shared_ptr<ReconfigureServer>>;

    /// Forgets which components are new.
    void unmeet();
    void run();

    executor::ParameterRequest request_;
    RangePolicy range_;
    ros::CallbackQueue queue_;
    std::atomic<bool> stop_{false};
    mutable std::mutex mutex_;   // protects wanted_ to new_
    Servers wanted_;             // by component
    Servers servers_;            // opened servers
    bool met_ = false;           // the master has been met, with the components of that time
    std::set<std::string> new_;  // components added later
    ParameterMirror mirror_;
    std::thread thread_;
};

}  // namespace rtcf::ros1
