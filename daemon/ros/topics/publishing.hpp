/// @file
/// The way out: takes the values out of all taps and publishes them.
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

/// Owned by the master watch. A thread of its own empties the taps each
/// millisecond, with or without a master, so that none overflows.
class Publishing {
   public:
    using Taps = std::vector<std::shared_ptr<executor::Tap>>;

    /// @param warn gets a line for the log; any thread
    explicit Publishing(std::function<void(const std::string&)> warn);
    ~Publishing();
    Publishing(const Publishing&) = delete;
    Publishing& operator=(const Publishing&) = delete;

    /// Sets how subscribers get messages; reconcile() opens topics anew that are open otherwise.
    /// Any thread; returns at once. @throws executor::Refusal for an expression that is not one
    void configure(const executor::BridgeSettings& settings);
    /// Sets the taps to empty from now on, after configure(). A topic that is open already goes
    /// on with its new tap at once; one that is latched keeps its last value until it is opened.
    /// Any thread; returns at once.
    void setTaps(Taps taps);

    /// Opens and closes topics until they are those of the taps. One that closes first sends what
    /// its tap has given: the last is what safe() wrote. Watch thread, with a node.
    Reconciled reconcile(ros::NodeHandle& handle);
    /// Closes all topics, after what the taps that were set have given so far was sent; reconcile()
    /// opens them again. Watch thread.
    void closeAll();
    /// Forgets closed topics that have no tap any more. Watch thread.
    void tidy();

    /// Topics that are open. Any thread.
    std::uint32_t open() const;
    /// Why a topic could not be opened; empty if all could. Any thread.
    std::string problem() const;

   private:
    struct Stream {
        std::shared_ptr<executor::Tap> tap;
        std::shared_ptr<TopicPublisher> publisher;
    };
    // How subscribers of each topic get messages.
    class Deliveries {
       public:
        explicit Deliveries(const executor::BridgeSettings& settings);
        Delivery of(const std::string& topic) const;

       private:
        std::uint32_t queue_;
        executor::NamePattern latched_;
        executor::NamePattern stamped_;
    };
    // A topic that changes its type closes before it opens again.
    using Key = std::tuple<std::string, std::string, std::string>;  // topic, type, MD5 sum
    using Publishers = std::vector<std::shared_ptr<TopicPublisher>>;

    static Key keyOf(const executor::Tap& tap);
    void makeReady();  // under the lock

    void run();
    // Sends those away who use up the memory for all.
    void makeRoom();
    static void drain(const Stream& stream, int most);
    static void leave(const std::vector<Stream>& streams, const std::vector<Stream>& next);
    std::vector<Stream> streams() const;
    void close(const Publishers& closing);

    mutable std::mutex mutex_;  // all below
    std::condition_variable changed_;
    Taps taps_;
    std::optional<Deliveries> deliveries_;                       // none before configure()
    std::map<Key, std::shared_ptr<TopicPublisher>> publishers_;  // one for each tap, and more
    std::uint64_t generation_ = 0;
    std::uint64_t served_ =
        0;  // the generation that the thread is at; it is done with those before
    bool stop_ = false;
    std::function<void(const std::string&)> warn_;
    // The thread's alone.
    std::chrono::steady_clock::time_point room_looked_at_;
    std::chrono::steady_clock::time_point room_told_;
    std::size_t disconnected_ = 0;  // since it was told
    std::thread thread_;
};

}  // namespace rtcf::ros1
