/// @file
/// The services of a runner, by which ROS peers look at a loop and ask for
/// changes. Looks are answered here; changes are handed to the supervisor, who
/// decides.
#pragma once

#include <ros/callback_queue.h>
#include <ros/service_server.h>

#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include "bridge/outside_call.hpp"

namespace ros {
class NodeHandle;
}
namespace rtcf::executor {
class RunnerView;
}

namespace rtcf::ros1 {

/// Owned by the introspection. Threads of its own, so that a change that
/// takes long keeps nobody from looking, or from stopping the loop.
class RunnerServices {
   public:
    /// @param ask called by a thread of this object, which waits for the answer
    RunnerServices(const executor::RunnerView& runner, executor::AskSupervisor ask);
    ~RunnerServices();
    RunnerServices(const RunnerServices&) = delete;
    RunnerServices& operator=(const RunnerServices&) = delete;

    /// @name Watch thread
    /// @{
    void open(ros::NodeHandle& handle, const std::string& name_space);  ///< with a master
    void close();
    /// @}

   private:
    template <typename Service, typename Callback>
    void advertise(ros::NodeHandle& handle, const std::string& name, ros::CallbackQueue& queue,
                   Callback callback);
    template <typename Response>
    bool change(const executor::OutsideCall& call, Response& response);

    const executor::RunnerView& runner_;
    const executor::AskSupervisor ask_;
    std::atomic<bool> stop_{false};
    std::atomic<bool> cancel_{false};  // waits for the supervisor
    ros::CallbackQueue looks_;
    ros::CallbackQueue changes_;
    ros::CallbackQueue stops_;
    std::vector<ros::ServiceServer> servers_;
    std::thread looking_;
    std::thread changing_;
    std::thread stopping_;
};

}  // namespace rtcf::ros1
