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

#include "exchange/injector.hpp"
#include "ros/roscpp/reconciled.hpp"
#include "ros/topics/clock_subscription.hpp"

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
    bool followsClock() const { return clock_.delivers(); }

    /// Subscribes and unsubscribes until the topics are those of the injectors. Watch thread.
    /// @param simulated whether the master says that time is simulated
    /// @param allowed whether peers may give the loop anything; if not, nothing is subscribed
    Reconciled reconcile(ros::NodeHandle& handle, bool simulated, bool allowed) {
        allowed_ = allowed;
        return reconcileTopics(handle, true) & clock_.reconcile(handle, queue_, simulated);
    }
    /// The same without a master: only new injectors of topics that are subscribed.
    void reconcileWithoutMaster(ros::NodeHandle& handle) { reconcileTopics(handle, false); }
    /// Unsubscribes all; reconcile() subscribes them again. Watch thread.
    void closeAll();

    /// Whether a peer that publishes the injector's topic is connected. Any thread.
    bool feeds(const executor::Injector& injector) const;
    /// Topics that are subscribed. Any thread.
    std::uint32_t open() const;
    /// Why a topic could not be subscribed; empty if all could. Any thread.
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
    mutable std::mutex mutex_;  // injectors_ and subscribers_
    Injectors injectors_;
    // By injector: a new one on the same topic subscribes anew, and so gets a latched value too.
    Subscribers subscribers_;
    std::thread thread_;
};

}  // namespace rtcf::ros1
