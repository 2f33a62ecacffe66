/// @file
/// Publishes the log on /rosout, with the component's name as if it were a node, the time of the
/// call, and the component's topics. It does not use roscpp's own publisher, which depends on
/// log4cxx.
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
struct GraphView;
}  // namespace rtcf::executor

namespace rtcf::ros1 {

/// Owned by main(), because both the log and the node use it. Any thread.
class Rosout {
   public:
    /// Publishes one record; does nothing while there is no node. Never waits for subscribers.
    void publish(const executor::LogEntry& entry);

    /// @name Called by the node
    /// @{
    void open(ros::NodeHandle& handle, const std::string& node);
    void close();
    bool isOpen() const;
    /// Sets the runner whose topics records list; null = none. It must outlive later calls of
    /// publish().
    void show(const executor::RunnerView* runner);
    /// @}

   private:
    using Topics = std::map<std::string, std::vector<std::string>>;  // by component

    const std::vector<std::string>& topicsOf(const std::string& component);

    mutable std::mutex mutex_;  // protects all members below
    const executor::RunnerView* runner_ = nullptr;
    std::shared_ptr<const executor::GraphView> graph_;  // graph view of topics_
    Topics topics_;
    ros::Publisher publisher_;
    std::string node_;
};

}  // namespace rtcf::ros1
