/// @file
/// One published topic of any type, whose messages are bytes.
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

/// Delivery of messages to subscribers.
struct Delivery {
    std::uint32_t queue = 0;  ///< messages kept for a slow subscriber
    bool latch = false;       ///< later subscribers get the last message
    bool stamped = false;     ///< send numbers and bools with the stamp of their cycle

    bool operator==(const Delivery& other) const {
        return queue == other.queue && latch == other.latch && stamped == other.stamped;
    }
};

/// Owned by Publishing. open() and close() call the master; publish() comes from another thread and
/// never waits for them.
class TopicPublisher {
   public:
    /// @param type type of the values
    TopicPublisher(std::string topic, const TypeInfo& type, Delivery delivery);

    /// Sets the delivery. It takes effect when the topic is closed and opened again; a topic that
    /// becomes latched keeps values at once. Any thread.
    void setDelivery(const Delivery& delivery);
    bool isOpen() const;
    /// True if it is open with another delivery than the one set.
    bool isOutdated() const;
    /// True if it is not open and has not failed just now. Watch thread.
    bool isDue() const;
    /// The error of the last open(), one line; empty = none.
    std::string problem() const;
    /// Number of messages dropped because too many, of all topics, waited for slow subscribers.
    std::uint64_t lost() const;

    void open(ros::NodeHandle& handle);
    /// Waits until all published messages are sent.
    /// @return false if a subscriber does not read them by the deadline
    bool flush(std::chrono::steady_clock::time_point deadline);
    /// Closes the topic. Messages that are not sent yet are lost.
    void close();

    /// Publishes one message, if the topic is open. A latched topic keeps the last message and
    /// sends it when it opens. The bytes are copied only for these purposes and for subscribers.
    /// Any thread.
    /// @param stamp_ns ROS time of the cycle, ns
    void publish(const std::uint8_t* bytes, std::uint32_t size, std::int64_t stamp_ns);

   private:
    struct Kept {
        std::vector<std::uint8_t> bytes;  // bytes of the value
        std::int64_t stamp_ns = 0;
    };

    void send(const std::uint8_t* bytes, std::uint32_t size, std::int64_t stamp_ns);

    const std::string topic_;
    const MessageType type_;                // type of the values
    mutable std::mutex mutex_;              // protects all members below
    Delivery delivery_;                     // wanted delivery
    Delivery opened_;                       // delivery of the open topic
    const MessageType* stamped_ = nullptr;  // stamped type of the open topic; null = not stamped
    std::string problem_;
    std::uint64_t lost_ = 0;
    std::optional<Kept> kept_;           // last value of a latched topic
    std::vector<std::uint8_t> message_;  // buffer for a stamped message
    Departures departures_{false};
    ros::Publisher publisher_;
    Retry retry_;  // watch thread
};

}  // namespace rtcf::ros1
