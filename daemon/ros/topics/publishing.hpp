/// @file
/// Publishes the values of all taps.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include "bridge/bridge.hpp"
#include "exchange/tap.hpp"
#include "names/name_pattern.hpp"
#include "ros/roscpp/reconciled.hpp"
#include "ros/topics/topic_publisher.hpp"

namespace rtcf::ros1 {

/// Owned by RosInterface. A separate thread empties the taps every millisecond, with or without a
/// master, so that they do not overflow.
class Publishing {
   public:
    using Taps = std::vector<std::shared_ptr<executor::Tap>>;

    /// @param warn receives lines for the log; any thread
    explicit Publishing(std::function<void(const std::string&)> warn);
    ~Publishing();
    Publishing(const Publishing&) = delete;
    Publishing& operator=(const Publishing&) = delete;

    /// Sets the delivery to subscribers; reconcile() reopens topics with another delivery. Any
    /// thread; returns at once.
    /// @throws executor::Error if an expression is invalid
    void configure(const executor::BridgeSettings& settings);
    /// Sets the taps. After configure(). An open topic continues at once with its new tap; a
    /// latched one keeps its last value until it is opened. Any thread; returns at once.
    void setTaps(Taps taps);

    /// Opens and closes topics to match the taps. Before a topic closes, it publishes the remaining
    /// values of its tap; the last one is from safe(). Watch thread, with a node.
    Reconciled reconcile(ros::NodeHandle& handle);
    /// Publishes the remaining values of all taps, and closes all topics; reconcile() opens them
    /// again. Watch thread.
    void closeAll();
    /// Removes closed topics without a tap. Watch thread.
    void tidy();

    /// Number of open topics. Any thread.
    std::uint32_t open() const;
    /// The error of a topic; empty = none. Any thread.
    std::string problem() const;

   private:
    struct Stream {
        std::shared_ptr<executor::Tap> tap;
        std::shared_ptr<TopicPublisher> publisher;
    };
    // The delivery of each topic.
    class Deliveries {
       public:
        explicit Deliveries(const executor::BridgeSettings& settings);
        Delivery of(const std::string& topic) const;

       private:
        std::uint32_t queue_;
        executor::NamePattern latched_;
        executor::NamePattern stamped_;
    };
    // Contains the type, so that a topic that changes its type is closed first.
    using Key = std::tuple<std::string, std::string, std::string>;  // topic, type, MD5 sum
    using Publishers = std::vector<std::shared_ptr<TopicPublisher>>;

    static Key keyOf(const executor::Tap& tap);
    void makeReady();  // with mutex_ held

    void run();
    // Disconnects subscribers that exhaust the shared memory.
    void makeRoom();
    static void drain(const Stream& stream, int most);
    static void leave(const std::vector<Stream>& streams, const std::vector<Stream>& next);
    std::vector<Stream> streams() const;
    void close(const Publishers& closing);

    mutable std::mutex mutex_;  // protects all members below
    std::condition_variable changed_;
    Taps taps_;
    std::optional<Deliveries> deliveries_;  // unset before configure()
    // One for each tap, and for closing topics.
    std::map<Key, std::shared_ptr<TopicPublisher>> publishers_;
    std::uint64_t generation_ = 0;
    std::uint64_t served_ = 0;  // generation that the thread serves
    bool stop_ = false;
    std::function<void(const std::string&)> warn_;
    // Publishing thread only.
    std::chrono::steady_clock::time_point room_looked_at_;
    std::chrono::steady_clock::time_point room_told_;
    std::size_t disconnected_ = 0;  // since the last report
    std::thread thread_;
};

}  // namespace rtcf::ros1
