/// @file
/// The subscription of /clock, the time of a simulation. It sets the loop's clock if the loop
/// follows it, and ros::Time in this process.
#pragma once

#include <ros/subscriber.h>

#include <atomic>
#include <memory>
#include <mutex>

#include "loop/simulated_clock.hpp"
#include "ros/roscpp/reconciled.hpp"

namespace ros {
class CallbackQueueInterface;
class NodeHandle;
}  // namespace ros

namespace rtcf::ros1 {

/// Owned by Subscribing, whose thread delivers ticks and other messages in order of arrival.
class ClockSubscription {
   public:
    /// Sets the receiver of ticks; null = none. Any thread; returns at once.
    void setClock(std::shared_ptr<executor::SimulatedClock> clock);

    /// Subscribes or unsubscribes as wanted. Calls the master.
    /// @param simulated the master's /use_sim_time
    Reconciled reconcile(ros::NodeHandle& handle, ros::CallbackQueueInterface& queue,
                         bool simulated);
    void close();

    /// True if ticks are delivered to a receiver. Any thread.
    bool delivers() const;

   private:
    void deliver(std::int64_t now_ns);

    std::atomic<bool> open_{false};
    mutable std::mutex mutex_;  // protects clock_
    std::shared_ptr<executor::SimulatedClock> clock_;
    ros::Subscriber subscriber_;  // watch thread only
};

}  // namespace rtcf::ros1
