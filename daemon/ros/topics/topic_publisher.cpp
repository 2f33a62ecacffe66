#include "ros/topics/topic_publisher.hpp"

#include <ros/node_handle.h>

#include <new>

#include "ros/roscpp/raw_message.hpp"

namespace rtcf::ros1 {

TopicPublisher::TopicPublisher(std::string topic, const TypeInfo& type, std::uint32_t queue,
                               bool latch)
    : topic_(std::move(topic)),
      type_(type.ros_type),
      md5_(type.ros_md5),
      definition_(type.ros_definition),
      queue_(queue),
      latch_(latch) {}

bool TopicPublisher::serves(const TypeInfo& type) const {
    return type_ == type.ros_type && md5_ == type.ros_md5;
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

void TopicPublisher::send(const std::uint8_t* bytes, std::size_t size) {
    try {
        publisher_.publish(RawView{bytes, static_cast<std::uint32_t>(size)});
    } catch (const std::bad_alloc&) {
        ++lost_;
    }
}

void TopicPublisher::open(ros::NodeHandle& handle) {
    ros::AdvertiseOptions options(topic_, queue_, md5_, type_, definition_);
    options.has_header = startsWithHeader(definition_);
    options.latch = latch_;
    ros::Publisher publisher;
    std::string problem;
    try {
        publisher = handle.advertise(options);
        if (!publisher) problem = "it is published in this process with another type";
    } catch (const std::exception& error) {
        problem = error.what();
    }
    const std::lock_guard lock(mutex_);
    publisher_ = publisher;
    if (publisher_ && !kept_.empty()) send(kept_.data(), kept_.size());
    problem_ = problem.empty() ? "" : "cannot publish " + topic_ + " as " + type_ + ": " + problem;
    retry_.note(problem_.empty());
}

bool TopicPublisher::isDue() const { return !isOpen() && retry_.due(); }

void TopicPublisher::inherit(const TopicPublisher& before) {
    const std::scoped_lock lock(mutex_, before.mutex_);
    if (latch_ && before.type_ == type_ && before.md5_ == md5_) kept_ = before.kept_;
}

void TopicPublisher::close() { shutDown(mutex_, publisher_); }

void TopicPublisher::publish(const std::uint8_t* bytes, std::uint32_t size) {
    const std::lock_guard lock(mutex_);
    if (publisher_) send(bytes, size);
    if (latch_) kept_.assign(bytes, bytes + size);
}

}  // namespace rtcf::ros1
