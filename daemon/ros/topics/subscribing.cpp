#include "ros/topics/subscribing.hpp"

#include <ros/master.h>
#include <ros/this_node.h>
#include <xmlrpcpp/XmlRpcException.h>
#include <xmlrpcpp/XmlRpcValue.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <set>
#include <utility>

#include "ros/threads/quiet_thread.hpp"
#include "ros/topics/topic_subscriber.hpp"

namespace rtcf::ros1 {

namespace {

using Connection = std::pair<std::string, std::string>;  // topic and MD5 sum of its type

Connection connection(const executor::Injector& injector) {
    return {injector.topic(), injector.type().ros_md5};
}

using Publishers = std::map<std::string, std::set<std::string>>;  // nodes by topic

// The publishers that the master knows; unset without an answer. Calls the master.
// @param caller this node's name
std::optional<Publishers> publishersAt(const std::string& caller) {
    Publishers publishers;
    XmlRpc::XmlRpcValue request;
    XmlRpc::XmlRpcValue response;
    XmlRpc::XmlRpcValue state;
    request[0] = caller;
    if (!ros::master::execute("getSystemState", request, response, state, false))
        return std::nullopt;
    try {
        // NOLINTBEGIN(modernize-loop-convert): its begin() is for structs
        XmlRpc::XmlRpcValue& topics = state[0];
        for (int topic = 0; topic < topics.size(); ++topic) {
            XmlRpc::XmlRpcValue& nodes = topics[topic][1];
            std::set<std::string>& names = publishers[topics[topic][0]];
            for (int node = 0; node < nodes.size(); ++node)
                names.insert(static_cast<std::string&>(nodes[node]));
        }
        // NOLINTEND(modernize-loop-convert)
    } catch (const XmlRpc::XmlRpcException&) {
        return std::nullopt;  // not a master of ROS
    }
    return publishers;
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
    std::optional<Publishers> publishers;
    if (!opening.empty()) publishers = publishersAt(ros::this_node::getName());
    for (const auto& subscriber : opening) {
        std::optional<std::set<std::string>> before;
        if (publishers) before = (*publishers)[subscriber->topic()];
        if (!subscriber->open(handle, queue_, std::move(before))) result = Reconciled::Later;
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
    constexpr std::chrono::milliseconds kTurn{100};
    auto next = std::chrono::steady_clock::now();
    while (!stop_) {
        queue_.callAvailable(ros::WallDuration(0.1));
        const auto now = std::chrono::steady_clock::now();
        if (now < next) continue;  // called for each message
        next = now + kTurn;
        const std::lock_guard lock(mutex_);
        for (const auto& [injector, subscriber] : subscribers_) subscriber->watchConnections();
    }
}

}  // namespace rtcf::ros1
