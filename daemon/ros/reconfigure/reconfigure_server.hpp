/// @file
/// The dynamic_reconfigure server of one component, based on its declared parameters: the service
/// `set_parameters` and the latched topics `parameter_descriptions` and `parameter_updates` below
/// its name.
#pragma once

#include <dynamic_reconfigure/Reconfigure.h>
#include <ros/publisher.h>
#include <ros/service_server.h>

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "bridge/bridge.hpp"
#include "ros/roscpp/handles.hpp"

namespace ros {
class CallbackQueueInterface;
class NodeHandle;
}  // namespace ros

namespace rtcf::ros1 {

/// Policy for values out of range. Owned by Reconfiguring.
struct RangePolicy {
    std::atomic<bool> refuse{false};  ///< true = the call fails; false = values are clamped
    std::function<void(const std::string& component, const std::string& line)> warn;
    std::atomic<bool> allowed{true};  ///< peers may change parameters
};

/// Owned by Reconfiguring.
class ReconfigureServer {
   public:
    using Set = std::shared_ptr<const executor::ParameterSet>;

    /// @param request requests a change
    /// @param ending  becomes true when requests get no more answers
    ReconfigureServer(Set set, executor::ParameterRequest request, const RangePolicy& range,
                      const std::atomic<bool>& ending);

    /// Opens the service and the topics. Watch thread.
    void open(ros::NodeHandle& handle, ros::CallbackQueueInterface& queue);
    void close();
    bool isOpen() const;
    /// True if it is not open and has not failed just now.
    bool isDue() const;
    /// The error of the last open(), one line; empty = none.
    std::string problem() const;

    /// Sets the values, and publishes changed ones. Any thread; returns at once.
    void update(Set set);
    Set set() const;

   private:
    bool change(const dynamic_reconfigure::ReconfigureRequest& asked,
                dynamic_reconfigure::ReconfigureResponse& answer);

    const executor::ParameterRequest request_;
    const RangePolicy& range_;
    const std::atomic<bool>& ending_;
    mutable std::mutex mutex_;  // protects all members below
    Set set_;
    std::string problem_;
    ros::Publisher descriptions_;
    ros::Publisher updates_;
    ros::ServiceServer service_;
    Retry retry_;  // watch thread
};

}  // namespace rtcf::ros1
