/// @file
/// The log on its way to /rosout: under a logger per component, with the time
/// of the call. roscpp's own way there is not used, as it goes by log4cxx.
#pragma once

#include <ros/publisher.h>

#include <mutex>
#include <string>

#include "logging/log.hpp"

namespace ros {
class NodeHandle;
}

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
    /// @}

   private:
    mutable std::mutex mutex_;  // all below
    ros::Publisher publisher_;
    std::string node_;
};

}  // namespace rtcf::ros1
