/// @file
/// The log on its way to /rosout: under the component's name, as if it were a
/// node, with the time of the call and the component's topics. roscpp's own way there is not used,
/// as it goes by log4cxx.
#pragma once

#include <ros/publisher.h>

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "logging/log.hpp"

namespace ros {
class NodeHandle;
}
namespace rtcf::executor {
class RunnerView;
struct GraphSnapshot;
}  // namespace rtcf::executor

namespace rtcf::ros1 {

/// Owned by the program, as the log and the node both need it. Any thread.
class Rosout {
   public:
    /// Publishes one record, or nothing while there is no node. Waits for nobody.
    void publish(const executor::LogEntry& entry);

    /// @name By the node
    /// @{
    void open(ros::NodeHandle& handle, const std::string& node);
    void close();
    bool isOpen() const;
    /// Whose topics are told; outlives all calls of publish(), or null before that.
    void show(const executor::RunnerView* runner);
    /// @}

   private:
    using Topics = std::map<std::string, std::vector<std::string>>;  // by component

    const std::vector<std::string>& topicsOf(const std::string& component);

    mutable std::mutex mutex_;  // all below
    const executor::RunnerView* runner_ = nullptr;
    std::shared_ptr<const executor::GraphSnapshot> graph_;  // that topics_ are of
    Topics topics_;
    ros::Publisher publisher_;
    std::string node_;
};

}  // namespace rtcf::ros1
