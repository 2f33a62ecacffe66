#include "ros/topics/clock_subscription.hpp"

#include <ros/node_handle.h>
#include <rosgraph_msgs/Clock.h>

#include "realtime/cycle_counter.hpp"

namespace rtcf::ros1 {

void ClockSubscription::setClock(std::shared_ptr<executor::SimulatedClock> clock) {
    const std::lock_guard lock(mutex_);
    clock_ = std::move(clock);
}

bool ClockSubscription::delivers() const {
    const std::lock_guard lock(mutex_);
    return open_ && clock_ != nullptr;
}

Reconciled ClockSubscription::reconcile(ros::NodeHandle& handle, ros::CallbackQueueInterface& queue,
                                        bool simulated) {
    bool wanted = simulated;
    {
        const std::lock_guard lock(mutex_);
        wanted = wanted || clock_ != nullptr;
    }
    if (wanted == static_cast<bool>(subscriber_)) return Reconciled::Done;
    if (!wanted) {
        close();
        return Reconciled::Done;
    }
    using Message = boost::shared_ptr<const rosgraph_msgs::Clock>;
    const boost::function<void(const Message&)> take = [this](const Message& message) {
        deliver(static_cast<std::int64_t>(message->clock.toNSec()));
    };
    ros::SubscribeOptions options;
    // No tick may be lost, and messages are small.
    constexpr std::uint32_t kQueue = 100'000;
    options.init<rosgraph_msgs::Clock>("/clock", kQueue, take);
    options.callback_queue = &queue;
    options.transport_hints = ros::TransportHints().tcpNoDelay();
    ros::Time::setNow({});  // 0 until the first tick, as for any node
    subscriber_ = handle.subscribe(options);
    open_ = static_cast<bool>(subscriber_);
    if (!open_) ros::Time::init();
    return open_ ? Reconciled::Done : Reconciled::Later;
}

void ClockSubscription::close() {
    const bool was_open = open_.exchange(false);
    subscriber_.shutdown();
    // Back to the machine's time; there is no other function for it.
    if (was_open) ros::Time::init();
}

void ClockSubscription::deliver(std::int64_t now_ns) {
    std::shared_ptr<executor::SimulatedClock> clock;
    {
        const std::lock_guard lock(mutex_);
        ros::Time now;
        ros::Time::setNow(now.fromNSec(static_cast<std::uint64_t>(now_ns)));
        clock = clock_;
    }
    if (clock != nullptr) clock->tick(now_ns, executor::monotonicNow());
}

}  // namespace rtcf::ros1
