#include "ros/topics/subscribing.hpp"

#include <algorithm>
#include <set>

#include "ros/threads/quiet_thread.hpp"
#include "ros/topics/topic_subscriber.hpp"

namespace rtcf::ros1 {

namespace {

using Connection = std::pair<std::string, std::string>;  // topic and MD5 sum of its type

Connection connection(const executor::Injector& injector) {
    return {injector.topic(), injector.type().ros_md5};
}

}  // namespace

Subscribing::Subscribing() {
    thread_ = quietThread("ros-deliver", [this] { run(); });
}

Subscribing::~Subscribing() {
    stop_ = true;
    queue_.disable();  // wakes the thread up
    thread_.join();
}

void Subscribing::setInjectors(Injectors injectors) {
    const std::lock_guard lock(mutex_);
    injectors_ = std::move(injectors);
    for (const auto& [injector, subscriber] : subscribers_) {
        const bool stays =
            std::find(injectors_.begin(), injectors_.end(), injector) != injectors_.end();
        if (!stays) subscriber->mute();
    }
}

Reconciled Subscribing::reconcileTopics(ros::NodeHandle& handle, bool master) {
    std::vector<std::shared_ptr<TopicSubscriber>> closing_first;
    std::vector<std::shared_ptr<TopicSubscriber>> opening;
    std::vector<std::shared_ptr<TopicSubscriber>> closing;
    {
        const std::lock_guard lock(mutex_);
        // roscpp calls the master only for the first and the last subscriber of a topic.
        std::set<Connection> served;
        for (const auto& [injector, subscriber] : subscribers_) {
            if (subscriber->isOpen()) served.insert(connection(*injector));
        }
        Subscribers wanted;
        std::map<std::string, Connection> topics;
        for (const auto& injector : injectors_) {
            if (!allowed_) break;
            const auto found = subscribers_.find(injector);
            auto subscriber = found != subscribers_.end()
                                  ? found->second
                                  : std::make_shared<TopicSubscriber>(injector);
            if (subscriber->isDue() && (master || served.count(connection(*injector)) != 0))
                opening.push_back(subscriber);
            wanted[injector] = std::move(subscriber);
            topics[injector->topic()] = connection(*injector);
        }
        for (const auto& [injector, subscriber] : subscribers_) {
            if (wanted.count(injector) != 0) continue;
            const auto topic = topics.find(injector->topic());
            const bool goes_on = topic != topics.end() && topic->second == connection(*injector);
            if (!master && !goes_on) {
                wanted[injector] = subscriber;  // keep it, muted, until there is a master
            } else if (topic != topics.end() && !goes_on) {
                closing_first.push_back(subscriber);  // roscpp allows one type per topic
            } else {
                // Closed after others are opened, so that peers stay connected.
                closing.push_back(subscriber);
            }
        }
        subscribers_ = std::move(wanted);
    }
    // Without the lock, because closing waits for callbacks.
    for (const auto& subscriber : closing_first) subscriber->close();
    Reconciled result = Reconciled::Done;
    for (const auto& subscriber : opening) {
        if (!subscriber->open(handle, queue_)) result = Reconciled::Later;
    }
    for (const auto& subscriber : closing) subscriber->close();
    return result;
}

void Subscribing::closeAll() {
    Subscribers closing;
    {
        const std::lock_guard lock(mutex_);
        closing.swap(subscribers_);
    }
    for (const auto& [injector, subscriber] : closing) subscriber->close();
    clock_.close();
}

bool Subscribing::feeds(const executor::Injector& injector) const {
    const std::lock_guard lock(mutex_);
    return std::any_of(subscribers_.begin(), subscribers_.end(), [&](const auto& each) {
        return each.first.get() == &injector && each.second->hasPeers();
    });
}

std::uint32_t Subscribing::open() const {
    const std::lock_guard lock(mutex_);
    std::uint32_t count = 0;
    for (const auto& [injector, subscriber] : subscribers_) count += subscriber->isOpen() ? 1 : 0;
    return count;
}

std::string Subscribing::problem() const {
    const std::lock_guard lock(mutex_);
    for (const auto& [injector, subscriber] : subscribers_) {
        if (!subscriber->problem().empty()) return subscriber->problem();
    }
    return {};
}

void Subscribing::run() {
    while (!stop_) queue_.callAvailable(ros::WallDuration(0.1));
}

}  // namespace rtcf::ros1
