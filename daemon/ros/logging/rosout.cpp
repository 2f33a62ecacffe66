#include "ros/logging/rosout.hpp"

#include <ros/node_handle.h>
#include <rosgraph_msgs/Log.h>

#include "ros/roscpp/handles.hpp"

#include "view/runner_view.hpp"

namespace rtcf::ros1 {

namespace {

constexpr std::uint32_t kQueue = 1000;

rosgraph_msgs::Log::_level_type rosLevelTo(LogLevel level) {
    switch (level) {
        case LogLevel::Debug:
            return rosgraph_msgs::Log::DEBUG;
        case LogLevel::Info:
            return rosgraph_msgs::Log::INFO;
        case LogLevel::Warn:
            return rosgraph_msgs::Log::WARN;
        case LogLevel::Error:
            return rosgraph_msgs::Log::ERROR;
        case LogLevel::Fatal:
            break;
    }
    return rosgraph_msgs::Log::FATAL;
}

ros::Time timeOf(const executor::LogEntry& entry) {
    ros::Time time;
    return time.fromNSec(static_cast<std::uint64_t>(entry.time_ns));
}

}  // namespace

void Rosout::publish(const executor::LogEntry& entry) {
    rosgraph_msgs::Log message;
    message.level = rosLevelTo(entry.level);
    message.msg = entry.message;
    message.file = entry.file;
    message.function = entry.function;
    message.line = entry.line;
    if (message.file.empty()) {  // a message of the executor about a component or the loop
        message.file = "rtcf-executor";
        message.function = "report";
    }
    const std::lock_guard lock(mutex_);
    if (!publisher_) return;
    // Under simulated time, only the present time is known, which is hardly later than the call.
    // Without a node, there is no ROS time.
    message.header.stamp = ros::Time::isSimTime() ? ros::Time::now() : timeOf(entry);
    // The node's own messages have the node's name, as for any node.
    message.name = entry.component.empty() ? node_ : entry.component;
    message.topics = topicsOf(entry.component);
    publisher_.publish(message);
}

void Rosout::show(const executor::RunnerView* runner) {
    const std::lock_guard lock(mutex_);
    runner_ = runner;
}

// The topics of a component; updated when the graph has changed.
const std::vector<std::string>& Rosout::topicsOf(const std::string& component) {
    static const std::vector<std::string> none;
    if (runner_ == nullptr) return none;
    if (const auto graph = runner_->graph(); graph != graph_) {
        graph_ = graph;
        topics_.clear();
        for (const executor::ConnectionView& connection : graph->connections) {
            const auto add = [&](const executor::EndpointRange& endpoints) {
                for (const executor::EndpointView& endpoint : endpoints) {
                    auto& topics = topics_[graph->components[endpoint.component]->full_name];
                    if (topics.empty() || topics.back() != connection.name)
                        topics.emplace_back(connection.name);
                }
            };
            if (connection.published) add(connection.writers);
            if (connection.subscribed) add(connection.readers);
        }
    }
    const auto found = topics_.find(component);
    return found != topics_.end() ? found->second : none;
}

void Rosout::open(ros::NodeHandle& handle, const std::string& node) {
    // Latched, as in roscpp: a console that starts later gets the last record.
    const ros::Publisher publisher = handle.advertise<rosgraph_msgs::Log>("/rosout", kQueue, true);
    const std::lock_guard lock(mutex_);
    publisher_ = publisher;
    node_ = node;
}

void Rosout::close() { shutDown(mutex_, publisher_); }

bool Rosout::isOpen() const {
    const std::lock_guard lock(mutex_);
    return publisher_ != nullptr;
}

}  // namespace rtcf::ros1
