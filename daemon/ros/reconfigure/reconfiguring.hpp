/// @file
/// Parameters on ROS: a dynamic_reconfigure server for each component that has
/// any, and their values on the parameter server.
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

/// Owned by the master watch. A thread of its own answers the services.
class Reconfiguring {
   public:
    using Sets = std::vector<std::shared_ptr<const executor::ParameterSet>>;

    /// @param warn hears of values that were out of range; any thread
    explicit Reconfiguring(
        std::function<void(const std::string& component, const std::string& line)> warn);
    ~Reconfiguring();
    Reconfiguring(const Reconfiguring&) = delete;
    Reconfiguring& operator=(const Reconfiguring&) = delete;

    /// By which changes are asked for. Before all else.
    void serve(executor::ParameterRequest request) {
        request_ = request;
        mirror_.serve(std::move(request));
    }
    /// Whether a call with a value out of range fails. Any thread.
    void refuseOutOfRange(bool refuse) noexcept { range_.refuse = refuse; }
    /// The parameters to offer from now on. Any thread; returns at once.
    void setSets(const Sets& sets);
    /// Nobody answers requests any more: those under way fail. Any thread.
    void end() noexcept { stop_ = true; }

    /// Opens, closes and uploads what is wanted. Watch thread, with a master.
    Reconciled reconcile(ros::NodeHandle& handle, ParallelCalls& master,
                         const ParameterMirror::Caller& caller);
    /// Whether peers may change parameters; if not, they are shown. Watch thread.
    void allow(bool allowed);
    /// The master says that a parameter or a namespace has been written. Any thread.
    void noteWritten(const std::string& key) { mirror_.noteWritten(key); }
    /// The master is another one. Watch thread.
    void forget();
    /// Closes all; reconcile() opens them again. Watch thread.
    void closeAll(ParallelCalls& master, const ParameterMirror::Caller& caller,
                  std::chrono::steady_clock::time_point deadline);

    /// Why one could not be opened; empty if all could. Any thread.
    std::string problem() const;

   private:
    using Servers = std::map<std::string, std::shared_ptr<ReconfigureServer>>;

    /// Components that come from now on are new to a master that comes then.
    void unmeet();
    void run();

    executor::ParameterRequest request_;
    RangePolicy range_;
    ros::CallbackQueue queue_;
    std::atomic<bool> stop_{false};
    mutable std::mutex mutex_;   // all down to new_
    Servers wanted_;             // by component
    Servers servers_;            // that have been opened
    bool met_ = false;           // the components that were there when the master came
    std::set<std::string> new_;  // components that came later
    ParameterMirror mirror_;
    std::thread thread_;
};

}  // namespace rtcf::ros1
