/// @file
/// One topic that the node subscribes: any type, taken as bytes.
#pragma once

#include <ros/subscriber.h>

#include <atomic>
#include <memory>
#include <mutex>
#include <string>

#include "exchange/injector.hpp"
#include "ros/roscpp/handles.hpp"

namespace ros {
class CallbackQueueInterface;
class NodeHandle;
}  // namespace ros

namespace rtcf::ros1 {

/// Owned by Subscribing. open() and close() speak to the master; messages come
/// from the thread that empties the callback queue.
class TopicSubscriber {
   public:
    explicit TopicSubscriber(std::shared_ptr<executor::Injector> injector);

    /// Delivers nothing from now on. Any thread; returns at once.
    void mute() { *muted_ = true; }

    /// @return false if it could not: to be tried again
    bool open(ros::NodeHandle& handle, ros::CallbackQueueInterface& queue);
    void close();

    bool isOpen() const;
    /// Peers that publish the topic are connected. Any thread.
    bool hasPeers() const;
    /// It is to be opened: it is not yet, and has not failed just now. Watch thread.
    bool isDue() const;
    /// Why it could not be opened, one line; empty if it could.
    std::string problem() const;

   private:
    std::shared_ptr<executor::Injector> injector_;
    std::shared_ptr<std::atomic<bool>> muted_;  // shared with callbacks that are under way
    mutable std::mutex mutex_;                  // all below
    ros::Subscriber subscriber_;
    std::string problem_;
    Retry retry_;  // watch thread
};

}  // namespace rtcf::ros1
