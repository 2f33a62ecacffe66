#include "ros/runner/cycle_topic.hpp"

#include <ros/node_handle.h>
#include <rtcf_msgs/Cycle.h>
#include <rtcf_msgs/IterationInfo.h>

#include <algorithm>
#include <chrono>

#include "names/names.hpp"
#include "ros/roscpp/handles.hpp"
#include "ros/threads/quiet_thread.hpp"
#include "view/runner_view.hpp"

namespace rtcf::ros1 {

namespace {

constexpr std::uint32_t kCyclesKept = 20000;  // messages kept for a slow subscriber: at least 0.4 s

ros::Time timeOf(std::int64_t ns) {
    return ros::Time().fromNSec(static_cast<std::uint64_t>(std::max<std::int64_t>(ns, 0)));
}

rtcf_msgs::IterationInfo infoOf(const executor::CycleRecord& record) {
    rtcf_msgs::IterationInfo message;
    message.stamp = timeOf(record.stamp_ns + record.latency_ns);
    message.duration_ns = static_cast<std::uint64_t>(std::max<std::int64_t>(record.duration_ns, 0));
    return message;
}

rtcf_msgs::Cycle cycleOf(const executor::CycleRecord& record) {
    rtcf_msgs::Cycle message;
    message.header.stamp = timeOf(record.stamp_ns);
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
    ros::Publisher cycles =
        handle.advertise<rtcf_msgs::Cycle>(executor::joinName(name_space, "cycles"), kCyclesKept);
    ros::Publisher iteration_info = handle.advertise<rtcf_msgs::IterationInfo>(
        executor::joinName(name_space, "iteration_info"), kCyclesKept);
    const std::lock_guard lock(mutex_);
    cycles_ = cycles;
    iteration_info_ = iteration_info;
}

void CycleTopic::close() {
    shutDown(mutex_, cycles_);
    shutDown(mutex_, iteration_info_);
}

void CycleTopic::run() {
    constexpr auto kBusy = std::chrono::milliseconds(5);
    constexpr auto kIdle = std::chrono::milliseconds(50);  // without a loop
    while (!stop_) {
        const bool found = publishAll();
        std::this_thread::sleep_for(found || runner_.loop().joinable() ? kBusy : kIdle);
    }
}

// @return true if there were cycles to publish
bool CycleTopic::publishAll() {
    const std::lock_guard lock(mutex_);
    const auto wanted = [](const ros::Publisher& publisher) {
        return static_cast<bool>(publisher) && publisher.getNumSubscribers() > 0;
    };
    const bool cycles = wanted(cycles_);
    const bool iteration_info = wanted(iteration_info_);
    if (!cycles && !iteration_info) {
        runner_.skipCycles();
        return false;
    }
    executor::CycleRecord record{};
    bool found = false;
    while (!stop_ && runner_.nextCycle(record)) {
        found = true;
        if (cycles) cycles_.publish(cycleOf(record));
        if (iteration_info) iteration_info_.publish(infoOf(record));
    }
    return found;
}

}  // namespace rtcf::ros1
