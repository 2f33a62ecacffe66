#include "ros/topics/topic_subscriber.hpp"

#include <ros/node_handle.h>
#include <ros/subscription_callback_helper.h>

#include "ros/transport/bounded_transport.hpp"
#include "ros/transport/raw_message.hpp"

namespace rtcf::ros1 {

TopicSubscriber::TopicSubscriber(std::shared_ptr<executor::Injector> injector)
    : injector_(std::move(injector)), muted_(std::make_shared<std::atomic<bool>>(false)) {}

LatchedBefore::LatchedBefore(std::optional<std::set<std::string>> publishers)
    : publishers_(std::move(publishers)) {
    // Without a master, only publishers that are connected already send.
    if (!publishers_) until_ = Clock::now() + kDelivery;
}

bool LatchedBefore::includes(const Header& header) {
    if (header == nullptr) return false;
    const auto sender = header->find("callerid");
    if (sender == header->end()) return false;
    const auto heard = heard_.find(sender->second);
    if (heard != heard_.end() && heard->second == header) return false;
    // The first message of a connection. If the publisher has sent one by an earlier connection,
    // it was published before this one.
    bool was_before = heard != heard_.end();
    if (waits()) was_before = was_before || !publishers_ || publishers_->count(sender->second) != 0;
    if (heard_.size() >= kMostHeard) heard_.clear();  // nodes with names of their own each time
    heard_[sender->second] = header;
    const auto latching = header->find("latching");
    return was_before && latching != header->end() && latching->second == "1";
}

bool LatchedBefore::waits() const { return !until_ || Clock::now() <= *until_; }

void LatchedBefore::noteConnections(std::size_t count) {
    if (!until_ && count >= publishers_->size()) until_ = Clock::now() + kDelivery;
}

bool TopicSubscriber::open(ros::NodeHandle& handle, ros::CallbackQueueInterface& queue,
                           std::optional<std::set<std::string>> publishers) {
    using Event = ros::MessageEvent<const RawBytes>;
    const auto latched = std::make_shared<LatchedBefore>(std::move(publishers));
    const boost::function<void(const Event&)> deliver = [injector = injector_, muted = muted_,
                                                         latched](const Event& event) {
        const bool is_old = latched->includes(event.getConnectionHeaderPtr());
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
    latched_ = latched;
    problem_ = problem;
    retry_.note(subscriber_ != nullptr);
    return subscriber_ != nullptr;
}

bool TopicSubscriber::isDue() const { return !isOpen() && retry_.due(); }

void TopicSubscriber::close() {
    mute();
    shutDown(mutex_, subscriber_);
    const std::lock_guard lock(mutex_);
    if (peers_ > 0) injector_->setFed(false);
}

bool TopicSubscriber::isOpen() const {
    const std::lock_guard lock(mutex_);
    return subscriber_ != nullptr;
}

void TopicSubscriber::watchConnections() {
    const std::lock_guard lock(mutex_);
    if (subscriber_ == nullptr) return;
    const std::size_t count = subscriber_.getNumPublishers();
    if (latched_->waits()) latched_->noteConnections(count);
    // A message sets it, too, and the loss of a connection removes it: see reconnection.cpp.
    if (count > peers_ || (count == 0 && peers_ > 0)) injector_->setFed(count > 0);
    peers_ = count;
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
