/// @file
/// The way in: subscribes topics and delivers what arrives to the injectors.
#pragma once

#include <ros/callback_queue.h>

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "bridge/injector.hpp"
#include "ros/clock_subscription.hpp"

namespace ros {
class NodeHandle;
}

namespace rtcf::ros1 {

class TopicSubscriber;

/// Owned by the master watch. A thread of its own delivers the messages.
class Subscribing {
   public:
    using Injectors = std::vector<std::shared_ptr<executor::Injector>>;

    Subscribing();
    ~Subscribing();
    Subscribing(const Subscribing&) = delete;
    Subscribing& operator=(const Subscribing&) = delete;

    /// The injectors to feed from now on; others get nothing more. Any thread; returns at once.
    void setInjectors(Injectors injectors);
    /// Who gets the ticks of /clock from now on; null = nobody. Any thread; returns at once.
    void setClock(std::shared_ptr<executor::SimulatedClock> clock) {
        clock_.setClock(std::move(clock));
    }

    /// Ticks of /clock are delivered. Any thread.
    bool followsClock() const noexcept { return clock_.isOpen(); }

    /// Subscribes and unsubscribes until the topics are those of the injectors. Watch thread.
    /// @param master false: only what needs no master, a new injector of a topic that is subscribed
    /// @return true if anything was opened or closed
    bool reconcile(ros::NodeHandle& handle, bool master);
    /// Unsubscribes all; reconcile() subscribes them again. Watch thread.
    void closeAll();

    /// Topics that are subscribed. Any thread.
    std::uint32_t open() const;
    /// Why a topic could not be subscribed; empty if all could. Any thread.
    std::string problem() const;

   private:
    using Subscribers =
        std::map<std::shared_ptr<executor::Injector>, std::shared_ptr<TopicSubscriber>>;

    void run();

    ros::CallbackQueue queue_;
    ClockSubscription clock_;
    std::atomic<bool> stop_{false};
    mutable std::mutex mutex_;  // injectors_ and subscribers_
    Injectors injectors_;
    // By injector: a new one on the same topic subscribes anew, and so gets a latched value too.
    Subscribers subscribers_;
    std::thread thread_;
};

}  // namespace rtcf::ros1
