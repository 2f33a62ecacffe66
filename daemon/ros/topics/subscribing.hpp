/// @file
/// Subscribes topics and delivers messages to the injectors.
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

#include "exchange/injector.hpp"
#include "ros/roscpp/reconciled.hpp"
#include "ros/topics/clock_subscription.hpp"

namespace ros {
class NodeHandle;
}

namespace rtcf::ros1 {

class TopicSubscriber;

/// Owned by RosInterface. A separate thread delivers the messages.
class Subscribing {
   public:
    using Injectors = std::vector<std::shared_ptr<executor::Injector>>;

    Subscribing();
    ~Subscribing();
    Subscribing(const Subscribing&) = delete;
    Subscribing& operator=(const Subscribing&) = delete;

    /// Sets the injectors; others get no more messages. Any thread; returns at once.
    void setInjectors(Injectors injectors);
    /// Sets the receiver of the ticks of /clock; null = none. Any thread; returns at once.
    void setClock(std::shared_ptr<executor::SimulatedClock> clock) {
        clock_.setClock(std::move(clock));
    }

    /// True if ticks of /clock are delivered. Any thread.
    bool followsClock() const { return clock_.delivers(); }

    /// Subscribes and unsubscribes topics to match the injectors. Watch thread.
    /// @param simulated the master's /use_sim_time
    /// @param allowed true = peers may write inputs of the loop; false = nothing is subscribed
    Reconciled reconcile(ros::NodeHandle& handle, bool simulated, bool allowed) {
        allowed_ = allowed;
        return reconcileTopics(handle, true) & clock_.reconcile(handle, queue_, simulated);
    }
    /// The same without a master: only new injectors of subscribed topics.
    void reconcileWithoutMaster(ros::NodeHandle& handle) { reconcileTopics(handle, false); }
    /// Unsubscribes all topics; reconcile() subscribes them again. Watch thread.
    void closeAll();

    /// True if a peer that publishes the injector's topic is connected. Any thread.
    bool feeds(const executor::Injector& injector) const;
    /// Number of subscribed topics. Any thread.
    std::uint32_t open() const;
    /// The error of a topic; empty = none. Any thread.
    std::string problem() const;

   private:
    using Subscribers =
        std::map<std::shared_ptr<executor::Injector>, std::shared_ptr<TopicSubscriber>>;

    Reconciled reconcileTopics(ros::NodeHandle& handle, bool master);
    void run();

    ros::CallbackQueue queue_;
    ClockSubscription clock_;
    std::atomic<bool> stop_{false};
    bool allowed_ = true;       // watch thread
    mutable std::mutex mutex_;  // protects injectors_ and subscribers_
    Injectors injectors_;
    // By injector: a new one on the same topic subscribes again, so that it gets a latched value.
    Subscribers subscribers_;
    std::thread thread_;
};

}  // namespace rtcf::ros1
