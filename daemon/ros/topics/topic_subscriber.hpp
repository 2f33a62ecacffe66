/// @file
/// One subscribed topic of any type, whose messages are bytes.
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

/// Owned by Subscribing. open() and close() call the master; the thread of the callback queue
/// delivers messages.
class TopicSubscriber {
   public:
    explicit TopicSubscriber(std::shared_ptr<executor::Injector> injector);

    /// Stops delivering messages. Any thread; returns at once.
    void mute() { *muted_ = true; }

    /// Subscribes the topic.
    /// @return false if that failed; the caller repeats it later
    bool open(ros::NodeHandle& handle, ros::CallbackQueueInterface& queue);
    void close();

    bool isOpen() const;
    /// True if a peer that publishes the topic is connected. Any thread.
    bool hasPeers() const;
    /// True if it is not open and has not failed just now. Watch thread.
    bool isDue() const;
    /// The error of the last open(), one line; empty = none.
    std::string problem() const;

   private:
    std::shared_ptr<executor::Injector> injector_;
    std::shared_ptr<std::atomic<bool>> muted_;  // shared with running callbacks
    mutable std::mutex mutex_;                  // protects all members below
    ros::Subscriber subscriber_;
    std::string problem_;
    Retry retry_;  // watch thread
};

}  // namespace rtcf::ros1
