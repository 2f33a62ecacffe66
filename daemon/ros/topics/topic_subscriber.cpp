#include "ros/topics/topic_subscriber.hpp"

#include <ros/node_handle.h>
#include <ros/subscription_callback_helper.h>

#include "ros/transport/bounded_transport.hpp"
#include "ros/transport/raw_message.hpp"

namespace rtcf::ros1 {

TopicSubscriber::TopicSubscriber(std::shared_ptr<executor::Injector> injector)
    : injector_(std::move(injector)), muted_(std::make_shared<std::atomic<bool>>(false)) {}

bool LatchedBefore::includes(const std::map<std::string, std::string>& header) {
    if (publishers_.empty()) return false;
    if (Clock::now() > until_) {
        publishers_.clear();
        return false;
    }
    const auto sender = header.find("callerid");
    if (sender == header.end() || publishers_.erase(sender->second) == 0) return false;
    const auto latching = header.find("latching");
    return latching != header.end() && latching->second == "1";
}

bool TopicSubscriber::open(ros::NodeHandle& handle, ros::CallbackQueueInterface& queue,
                           std::set<std::string> publishers) {
    using Event = ros::MessageEvent<const RawBytes>;
    const boost::function<void(const Event&)> deliver =
        [injector = injector_, muted = muted_,
         latched = std::make_shared<LatchedBefore>(std::move(publishers))](const Event& event) {
            const bool is_old = latched->includes(event.getConnectionHeader());
            const RawBytes& message = *event.getConstMessage();
            if (*muted) return;
            injector->deliver(message.bytes.get(), message.size, executor::monotonicNow(), is_old);
        };
    ros::SubscribeOptions options;
    options.topic = injector_->topic();
    // Large, so that no message is lost before the injector, which decides whether only the newest
    // counts.
    constexpr std::uint32_t kQueue = 1000;
    options.queue_size = kQueue;
    options.md5sum = injector_->type().ros_md5;
    options.datatype = injector_->type().ros_type;
    options.helper = boost::make_shared<ros::SubscriptionCallbackHelperT<const Event&>>(deliver);
    options.callback_queue = &queue;
    options.transport_hints = ros::TransportHints().tcpNoDelay();
    ros::Subscriber subscriber;
    std::string problem;
    boundTopic(options.topic, injector_);
    try {
        subscriber = handle.subscribe(options);
    } catch (const std::exception& error) {
        problem =
            "cannot subscribe " + options.topic + " as " + options.datatype + ": " + error.what();
    }
    const std::lock_guard lock(mutex_);
    subscriber_ = subscriber;
    problem_ = problem;
    retry_.note(subscriber_ != nullptr);
    return subscriber_ != nullptr;
}

bool TopicSubscriber::isDue() const { return !isOpen() && retry_.due(); }

void TopicSubscriber::close() {
    mute();
    shutDown(mutex_, subscriber_);
}

bool TopicSubscriber::isOpen() const {
    const std::lock_guard lock(mutex_);
    return subscriber_ != nullptr;
}

bool TopicSubscriber::hasPeers() const {
    const std::lock_guard lock(mutex_);
    return subscriber_ != nullptr && subscriber_.getNumPublishers() > 0;
}

std::string TopicSubscriber::problem() const {
    const std::lock_guard lock(mutex_);
    return problem_;
}

}  // namespace rtcf::ros1
