/// @file
/// Parameters on ROS: a dynamic_reconfigure server for each component that has
/// any, and their values on the parameter server.
#pragma once

#include <ros/callback_queue.h>

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "bridge/bridge.hpp"
#include "ros/parameters/parameter_mirror.hpp"
#include "ros/reconfigure/reconfigure_server.hpp"
#include "ros/roscpp/master_client.hpp"

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

    /// Opens, closes and uploads until all is as it should be, or for a while. Watch thread, with a
    /// master. @return false if there is more to do
    bool reconcile(ros::NodeHandle& handle, MasterClient& master,
                   const ParameterMirror::Caller& caller);
    /// The values at the master's parameter server.
    ParameterMirror& mirror() noexcept { return mirror_; }
    /// Closes all; reconcile() opens them again. Watch thread.
    void closeAll();

    /// Why one could not be opened; empty if all could. Any thread.
    std::string problem() const;

   private:
    using Servers = std::map<std::string, std::shared_ptr<ReconfigureServer>>;

    void run();

    executor::ParameterRequest request_;
    RangePolicy range_;
    ros::CallbackQueue queue_;
    std::atomic<bool> stop_{false};
    mutable std::mutex mutex_;  // wanted_ and servers_
    Servers wanted_;            // by component
    Servers servers_;           // that have been opened
    ParameterMirror mirror_;
    std::thread thread_;
};

}  // namespace rtcf::ros1
