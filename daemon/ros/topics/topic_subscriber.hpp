/// @file
/// One subscribed topic of any type, whose messages are bytes.
#pragma once

#include <ros/subscriber.h>

#include <atomic>
#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>

#include <boost/shared_ptr.hpp>

#include "exchange/injector.hpp"
#include "ros/roscpp/handles.hpp"

namespace ros {
class CallbackQueueInterface;
class NodeHandle;
}  // namespace ros

namespace rtcf::ros1 {

/// Messages latched before a subscription or a connection: ROS 1 does not say when they were
/// published, so they are old. A publisher that registers later latches new messages. One thread.
class LatchedBefore {
   public:
    /// Header of a connection.
    using Header = boost::shared_ptr<std::map<std::string, std::string>>;

    /// @param publishers nodes that publish the topic at the moment; unset = unknown
    explicit LatchedBefore(std::optional<std::set<std::string>> publishers);

    /// True if the message of a connection is such a message.
    bool includes(const Header& header);
    /// True until the publishers of that moment have had time to send their messages.
    bool waits() const;
    /// Notes the number of publishers that are connected.
    void noteConnections(std::size_t count);

   private:
    using Clock = std::chrono::steady_clock;
    // Within this time after the connection, a latched message arrives.
    static constexpr std::chrono::seconds kDelivery{2};
    // Connections that are kept in mind.
    static constexpr std::size_t kMostHeard = 256;

    std::optional<std::set<std::string>> publishers_;
    std::optional<Clock::time_point> until_;  // unset = some are not connected yet
    std::map<std::string, Header> heard_;     // by sender: its last connection
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
    /// @param publishers nodes that publish it already; unset = unknown
    /// @return false if that failed; the caller repeats it later
    bool open(ros::NodeHandle& handle, ros::CallbackQueueInterface& queue,
              std::optional<std::set<std::string>> publishers);
    void close();

    /// Notes which publishers are connected, and tells the injector. Thread of the callback queue.
    void watchConnections();
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
    std::shared_ptr<LatchedBefore> latched_;
    std::string problem_;
    std::size_t peers_ = 0;
    Retry retry_;  // watch thread
};

}  // namespace rtcf::ros1
