/// @file
/// The subscription of /clock, by which a simulation gives its time: to the loop if that follows
/// it, and to all in this process that asks for ros::Time.
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

/// Owned by Subscribing, whose thread delivers the ticks: in the order in which they came among
/// the other messages.
class ClockSubscription {
   public:
    /// Who gets the ticks from now on; null = nobody. Any thread; returns at once.
    void setClock(std::shared_ptr<executor::SimulatedClock> clock);

    /// Subscribes or unsubscribes, as is wanted. Speaks to the master.
    /// @param simulated whether the master says that time is simulated
    Reconciled reconcile(ros::NodeHandle& handle, ros::CallbackQueueInterface& queue,
                         bool simulated);
    void close();

    /// Somebody gets the ticks from now on. Any thread.
    bool delivers() const;

   private:
    void deliver(std::int64_t now_ns);

    std::atomic<bool> open_{false};
    mutable std::mutex mutex_;  // clock_
    std::shared_ptr<executor::SimulatedClock> clock_;
    ros::Subscriber subscriber_;  // the watch thread's
};

}  // namespace rtcf::ros1
