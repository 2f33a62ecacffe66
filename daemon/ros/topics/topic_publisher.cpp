#include "ros/topics/topic_publisher.hpp"

#include <ros/node_handle.h>

#include <new>
#include <thread>

#include "ros/transport/raw_message.hpp"

namespace rtcf::ros1 {

TopicPublisher::TopicPublisher(std::string topic, const TypeInfo& type, Delivery delivery)
    : topic_(std::move(topic)),
      type_{type.ros_type, type.ros_md5, type.ros_definition},
      delivery_(delivery) {}

void TopicPublisher::setDelivery(const Delivery& delivery) {
    const std::lock_guard lock(mutex_);
    delivery_ = delivery;
    if (!delivery.latch) kept_.reset();
}

bool TopicPublisher::isOutdated() const {
    const std::lock_guard lock(mutex_);
    return publisher_ != nullptr && !(opened_ == delivery_);
}

bool TopicPublisher::isOpen() const {
    const std::lock_guard lock(mutex_);
    return publisher_ != nullptr;
}

std::string TopicPublisher::problem() const {
    const std::lock_guard lock(mutex_);
    return problem_;
}

std::uint64_t TopicPublisher::lost() const {
    const std::lock_guard lock(mutex_);
    return lost_;
}

void TopicPublisher::send(const std::uint8_t* bytes, std::uint32_t size, std::int64_t stamp_ns) {
    if (stamped_ != nullptr) {
        stampBytes(bytes, size, stamp_ns, message_);
        bytes = message_.data();
        size = static_cast<std::uint32_t>(message_.size());
    }
    try {
        publisher_.publish(RawView{bytes, size, &departures_});
    } catch (const std::bad_alloc&) {
        ++lost_;
    }
}

void TopicPublisher::open(ros::NodeHandle& handle) {
    Delivery delivery;
    {
        const std::lock_guard lock(mutex_);
        delivery = delivery_;
    }
    const MessageType* const stamped = delivery.stamped ? stampedType(type_.name) : nullptr;
    const MessageType& type = stamped != nullptr ? *stamped : type_;
    ros::AdvertiseOptions options(topic_, delivery.queue, type.md5, type.name, type.definition);
    options.has_header = startsWithHeader(type.definition);
    options.latch = delivery.latch;
    ros::Publisher publisher;
    std::string problem;
    try {
        publisher = handle.advertise(options);
        if (!publisher) problem = "this process publishes it with another type";
    } catch (const std::exception& error) {
        problem = error.what();
    }
    const std::lock_guard lock(mutex_);
    publisher_ = publisher;
    opened_ = delivery;
    stamped_ = stamped;
    departures_ = Departures(delivery.latch);
    if (publisher_ && kept_)
        send(kept_->bytes.data(), static_cast<std::uint32_t>(kept_->bytes.size()), kept_->stamp_ns);
    problem_ =
        problem.empty() ? "" : "cannot publish " + topic_ + " as " + type.name + ": " + problem;
    retry_.note(problem_.empty());
}

bool TopicPublisher::isDue() const { return !isOpen() && retry_.due(); }

bool TopicPublisher::flush(std::chrono::steady_clock::time_point deadline) {
    constexpr auto kPause = std::chrono::milliseconds(1);
    std::unique_lock lock(mutex_);
    if (!publisher_) return true;
    const Departures::Until sent = departures_.mark();
    while (!departures_.gone(sent)) {
        if (std::chrono::steady_clock::now() >= deadline) return false;
        lock.unlock();
        std::this_thread::sleep_for(kPause);
        lock.lock();
    }
    return true;
}

void TopicPublisher::close() {
    shutDown(mutex_, publisher_);
    const std::lock_guard lock(mutex_);
    departures_.release();
}

void TopicPublisher::publish(const std::uint8_t* bytes, std::uint32_t size, std::int64_t stamp_ns) {
    const std::lock_guard lock(mutex_);
    if (publisher_) send(bytes, size, stamp_ns);
    if (!delivery_.latch) return;
    if (!kept_) kept_.emplace();
    kept_->bytes.assign(bytes, bytes + size);
    kept_->stamp_ns = stamp_ns;
}

}  // namespace rtcf::ros1
