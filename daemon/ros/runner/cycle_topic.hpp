/// @file
/// The topics `<namespace>/cycles` and, for RTCF 2021, `<namespace>/iteration_info`: one message
/// per cycle.
#pragma once

#include <ros/publisher.h>

#include <atomic>
#include <mutex>
#include <thread>

namespace ros {
class NodeHandle;
}
namespace rtcf::executor {
class RunnerView;
}

namespace rtcf::ros1 {

/// Owned by Introspection. Its thread reads all cycles while a topic has a subscriber.
class CycleTopic {
   public:
    explicit CycleTopic(executor::RunnerView& runner);
    ~CycleTopic();
    CycleTopic(const CycleTopic&) = delete;
    CycleTopic& operator=(const CycleTopic&) = delete;

    /// @name Watch thread
    /// @{
    void open(ros::NodeHandle& handle, const std::string& name_space);  ///< with a master
    void close();
    /// @}

   private:
    void run();
    bool publishAll();

    executor::RunnerView& runner_;
    std::mutex mutex_;  // protects cycles_ and iteration_info_
    ros::Publisher cycles_;
    ros::Publisher iteration_info_;
    std::atomic<bool> stop_{false};
    std::thread thread_;
};

}  // namespace rtcf::ros1
