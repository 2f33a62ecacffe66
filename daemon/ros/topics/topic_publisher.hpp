/// @file
/// One topic that the node publishes: any type, given as bytes.
#pragma once

#include <ros/publisher.h>

#include <chrono>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "ros/roscpp/handles.hpp"
#include "ros/topics/stamped_type.hpp"
#include "ros/transport/raw_message.hpp"
#include "rtcf/port_type.hpp"

namespace ros {
class NodeHandle;
}

namespace rtcf::ros1 {

/// How subscribers get what is published.
struct Delivery {
    std::uint32_t queue = 0;  ///< messages kept for a slow one
    bool latch = false;       ///< those that come later get the last message
    bool stamped = false;     ///< a number or a bool goes with the time of its cycle

    bool operator==(const Delivery& other) const {
        return queue == other.queue && latch == other.latch && stamped == other.stamped;
    }
};

/// Owned by Publishing. open() and close() speak to the master; publish()
/// comes from another thread and never waits for them.
class TopicPublisher {
   public:
    /// @param type of the values it is given
    TopicPublisher(std::string topic, const TypeInfo& type, Delivery delivery);

    /// Sets how subscribers get messages. Subscribers see the change once the topic is closed and
    /// opened again; a topic that becomes latched keeps values from now on. Any thread.
    void setDelivery(const Delivery& delivery);
    bool isOpen() const;
    /// True if it is open with a delivery other than the one that is set.
    bool isOutdated() const;
    /// It is to be opened: it is not yet, and has not failed just now. Watch thread.
    bool isDue() const;
    /// Why it could not be opened, one line; empty if it could.
    std::string problem() const;
    /// Messages lost as too much waited for slow subscribers, of all topics.
    std::uint64_t lost() const;

    void open(ros::NodeHandle& handle);
    /// Waits until subscribers have been sent all that was published.
    /// @return false if one does not take it until then
    bool flush(std::chrono::steady_clock::time_point deadline);
    /// What has not been sent is lost.
    void close();

    /// Sends one message. While it is closed none is sent; of a latched topic the last one is
    /// kept, and sent whenever it opens. The bytes are copied only for that, or for a subscriber.
    /// Any thread.
    /// @param stamp_ns of the cycle, ROS time
    void publish(const std::uint8_t* bytes, std::uint32_t size, std::int64_t stamp_ns);

   private:
    struct Kept {
        std::vector<std::uint8_t> bytes;  // of the value
        std::int64_t stamp_ns = 0;
    };

    void send(const std::uint8_t* bytes, std::uint32_t size, std::int64_t stamp_ns);

    const std::string topic_;
    const MessageType type_;                // of the values
    mutable std::mutex mutex_;              // all below
    Delivery delivery_;                     // that is wanted
    Delivery opened_;                       // that it is open with
    const MessageType* stamped_ = nullptr;  // it is open with; null: the values are the messages
    std::string problem_;
    std::uint64_t lost_ = 0;
    std::optional<Kept> kept_;           // of a latched topic: its last value
    std::vector<std::uint8_t> message_;  // that is being stamped
    Departures departures_{false};
    ros::Publisher publisher_;
    Retry retry_;  // watch thread
};

}  // namespace rtcf::ros1
