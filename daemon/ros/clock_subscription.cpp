#include "ros/clock_subscription.hpp"

#include <ros/node_handle.h>
#include <rosgraph_msgs/Clock.h>

namespace rtcf::ros1 {

void ClockSubscription::setClock(std::shared_ptr<executor::SimulatedClock> clock) {
    const std::lock_guard lock(mutex_);
    clock_ = std::move(clock);
}

bool ClockSubscription::reconcile(ros::NodeHandle& handle, ros::CallbackQueueInterface& queue) {
    bool wanted = false;
    {
        const std::lock_guard lock(mutex_);
        wanted = clock_ != nullptr;
    }
    if (wanted == static_cast<bool>(subscriber_)) return false;
    if (!wanted) {
        close();
        return true;
    }
    using Message = boost::shared_ptr<const rosgraph_msgs::Clock>;
    const boost::function<void(const Message&)> take = [this](const Message& message) {
        deliver(static_cast<std::int64_t>(message->clock.toNSec()));
    };
    ros::SubscribeOptions options;
    // No tick is to be lost, and none is large.
    constexpr std::uint32_t kQueue = 100'000;
    options.init<rosgraph_msgs::Clock>("/clock", kQueue, take);
    options.callback_queue = &queue;
    options.transport_hints = ros::TransportHints().tcpNoDelay();
    subscriber_ = handle.subscribe(options);
    open_ = static_cast<bool>(subscriber_);
    return true;
}

void ClockSubscription::close() {
    open_ = false;
    subscriber_.shutdown();
}

void ClockSubscription::deliver(std::int64_t now_ns) {
    std::shared_ptr<executor::SimulatedClock> clock;
    {
        const std::lock_guard lock(mutex_);
        clock = clock_;
    }
    if (clock != nullptr) clock->tick(now_ns);
}

}  // namespace rtcf::ros1
