/// @file
/// One topic that the node publishes: any type, given as bytes.
#pragma once

#include <ros/publisher.h>

#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

#include "ros/roscpp/handles.hpp"
#include "rtcf/port_type.hpp"

namespace ros {
class NodeHandle;
}

namespace rtcf::ros1 {

/// Owned by Publishing. open() and close() speak to the master; publish()
/// comes from another thread and never waits for them.
class TopicPublisher {
   public:
    /// @param latch whether subscribers that come later get the last message
    TopicPublisher(std::string topic, const TypeInfo& type, std::uint32_t queue, bool latch);

    /// True if it takes messages of such a type.
    bool serves(const TypeInfo& type) const;
    std::uint32_t queue() const { return queue_; }
    bool latch() const { return latch_; }
    bool isOpen() const;
    /// It is to be opened: it is not yet, and has not failed just now. Watch thread.
    bool isDue() const;
    /// Takes over what another one of its topic has kept, if the type is the same.
    void inherit(const TopicPublisher& before);
    /// Why it could not be opened, one line; empty if it could.
    std::string problem() const;
    /// Messages lost as too much waited for slow subscribers, of all topics.
    std::uint64_t lost() const;

    void open(ros::NodeHandle& handle);
    void close();

    /// Sends one message. While it is closed none is sent; of a latched topic the last one is
    /// kept, and sent whenever it opens. The bytes are copied only for that, or for a subscriber.
    void publish(const std::uint8_t* bytes, std::uint32_t size);

   private:
    void send(const std::uint8_t* bytes, std::size_t size);

    std::string topic_;
    std::string type_;
    std::string md5_;
    std::string definition_;
    std::uint32_t queue_;
    bool latch_;
    mutable std::mutex mutex_;  // all below
    std::string problem_;
    std::uint64_t lost_ = 0;
    std::vector<std::uint8_t> kept_;
    ros::Publisher publisher_;
    Retry retry_;  // watch thread
};

}  // namespace rtcf::ros1
