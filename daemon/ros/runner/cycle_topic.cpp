#include "ros/runner/cycle_topic.hpp"

#include <ros/node_handle.h>
#include <rtcf_msgs/IterationInfo.h>

#include <chrono>

#include "graph/names.hpp"
#include "ros/roscpp/quiet_thread.hpp"
#include "runner/runner_view.hpp"

namespace rtcf::ros1 {

namespace {

constexpr std::uint32_t kQueue = 20000;  // messages for a slow subscriber: a second at the most

rtcf_msgs::IterationInfo messageOf(const executor::CycleRecord& record) {
    rtcf_msgs::IterationInfo message;
    message.stamp.fromNSec(static_cast<std::uint64_t>(record.stamp_ns));
    message.iteration = record.iteration;
    message.duration_ns = record.duration_ns;
    message.latency_ns = record.latency_ns;
    return message;
}

}  // namespace

CycleTopic::CycleTopic(executor::RunnerView& runner)
    : runner_(runner), thread_(quietThread("ros-cycles", [this] { run(); })) {}

CycleTopic::~CycleTopic() {
    stop_ = true;
    thread_.join();
}

void CycleTopic::open(ros::NodeHandle& handle, const std::string& name_space) {
    ros::Publisher publisher = handle.advertise<rtcf_msgs::IterationInfo>(
        executor::joinName(name_space, "iteration_info"), kQueue);
    const std::lock_guard lock(mutex_);
    publisher_ = publisher;
}

void CycleTopic::close() {
    ros::Publisher closing;
    {
        const std::lock_guard lock(mutex_);
        std::swap(closing, publisher_);
    }
    closing.shutdown();
}

void CycleTopic::run() {
    constexpr auto kBusy = std::chrono::milliseconds(5);
    constexpr auto kIdle = std::chrono::milliseconds(50);  // no loop: no cycles
    while (!stop_) {
        publishAll();
        std::this_thread::sleep_for(runner_.loop().joinable() ? kBusy : kIdle);
    }
}

void CycleTopic::publishAll() {
    const std::lock_guard lock(mutex_);
    const bool wanted = static_cast<bool>(publisher_) && publisher_.getNumSubscribers() > 0;
    executor::CycleRecord record{};
    while (!stop_ && runner_.popCycle(record)) {
        if (wanted) publisher_.publish(messageOf(record));
    }
}

}  // namespace rtcf::ros1
