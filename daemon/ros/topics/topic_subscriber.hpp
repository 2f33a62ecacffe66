/// @file
/// One subscribed topic of any type, whose messages are bytes.
#pragma once

#include <ros/subscriber.h>

#include <atomic>
#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <utility>

#include "exchange/injector.hpp"
#include "ros/roscpp/handles.hpp"

namespace ros {
class CallbackQueueInterface;
class NodeHandle;
}  // namespace ros

namespace rtcf::ros1 {

/// Messages latched before a subscription: ROS 1 does not say when they were published, so they are
/// old. A publisher that registers later latches what it publishes now.
class LatchedBefore {
   public:
    /// @param publishers nodes that publish the topic at the moment
    explicit LatchedBefore(std::set<std::string> publishers)
        : publishers_(std::move(publishers)), until_(Clock::now() + kDelivery) {}

    /// True if the message of a connection with this header is such a message. One thread.
    bool includes(const std::map<std::string, std::string>& header);

   private:
    using Clock = std::chrono::steady_clock;
    // Within this time, a connection is made and a latched message arrives.
    static constexpr std::chrono::seconds kDelivery{2};

    std::set<std::string> publishers_;  // that have sent nothing yet
    const Clock::time_point until_;
};

/// Owned by Subscribing. open() and close() call the master; the thread of the callback queue
/// delivers messages.
class TopicSubscriber {
   public:
    explicit TopicSubscriber(std::shared_ptr<executor::Injector> injector);

    const std::string& topic() const noexcept { return injector_->topic(); }
    /// Stops delivering messages. Any thread; returns at once.
    void mute() { *muted_ = true; }

    /// Subscribes the topic.
    /// @param publishers nodes that publish it already
    /// @return false if that failed; the caller repeats it later
    bool open(ros::NodeHandle& handle, ros::CallbackQueueInterface& queue,
              std::set<std::string> publishers);
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
