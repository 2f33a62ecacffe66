/// @file
/// The services of a runner, by which ROS peers query a loop and request changes. Queries are
/// answered here; changes are passed to rtcfd, which checks rights. Services of RTCF 2021 answer in
/// its format; our own have more fields.
#pragma once

#include <ros/callback_queue.h>
#include <ros/service_server.h>
#include <std_msgs/Bool.h>

#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include "bridge/outside_call.hpp"

namespace ros {
class NodeHandle;
}
namespace rtcf::executor {
class Log;
class RunnerView;
}  // namespace rtcf::executor

namespace rtcf::ros1 {

/// Owned by Introspection. It has three threads, so that a slow change delays neither queries nor a
/// stop.
class RunnerServices {
   public:
    /// @param ask requests a change from rtcfd; called in a thread of this object, which waits for
    /// the answer
    /// @param log receives reasons that responses have no field for; outlives this object
    RunnerServices(const executor::RunnerView& runner, executor::AskSupervisor ask,
                   executor::Log& log);
    ~RunnerServices();
    RunnerServices(const RunnerServices&) = delete;
    RunnerServices& operator=(const RunnerServices&) = delete;

    /// @name Watch thread
    /// @{
    void open(ros::NodeHandle& handle, const std::string& name_space);  ///< with a master
    void close();
    /// @}

   private:
    void openLikeRtcf2021(ros::NodeHandle& handle, const std::string& name_space);
    template <typename Service, typename Callback>
    void advertise(ros::NodeHandle& handle, const std::string& name, ros::CallbackQueue& queue,
                   Callback callback);
    template <typename Response>
    bool change(const executor::OutsideCall& call, Response& response);
    void changeAndLog(const executor::OutsideCall& call, std_msgs::Bool& success);
    void logFailure(const std::string& why);

    const executor::RunnerView& runner_;
    const executor::AskSupervisor ask_;
    executor::Log& log_;
    std::atomic<bool> stop_{false};
    std::atomic<bool> cancel_{false};  // ends waits for rtcfd
    ros::CallbackQueue looks_;
    ros::CallbackQueue changes_;
    ros::CallbackQueue stops_;
    std::vector<ros::ServiceServer> servers_;
    std::thread looking_;
    std::thread changing_;
    std::thread stopping_;
};

}  // namespace rtcf::ros1
