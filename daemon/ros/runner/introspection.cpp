#include "ros/runner/introspection.hpp"

#include <ros/node_handle.h>
#include <unistd.h>

#include <array>
#include <new>
#include <utility>
#include <vector>

#include "ros/roscpp/handles.hpp"
#include "ros/threads/quiet_thread.hpp"
#include "view/runner_view.hpp"

namespace rtcf::ros1 {

namespace {

std::string hostName() {
    std::array<char, 256> name{};
    return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "";
}

}  // namespace

Introspection::Introspection(executor::RunnerView& runner, const executor::AskSupervisor& ask,
                             executor::Log& log)
    : runner_(runner),
      cycles_(runner),
      services_(runner, ask, log),
      report_(runner, hostName()),
      health_(quietThread("ros-health", [this] { watchHealth(); })) {}

Introspection::~Introspection() {
    stop_ = true;
    health_.join();
}

void Introspection::open(ros::NodeHandle& handle, const std::string& node,
                         const std::string& name_space, bool serves) {
    if (open_ && name_space == name_space_ && serves == serves_) return;
    close();
    open_ = true;
    name_space_ = name_space;
    cycles_.open(handle, name_space);
    ros::Publisher diagnostics =
        handle.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10);
    {
        const std::lock_guard lock(mutex_);
        report_.nameAfter(node);
        diagnostics_ = diagnostics;
    }
    serves_ = serves;
    if (serves) services_.open(handle, name_space);
}

void Introspection::close() {
    if (!open_) return;
    open_ = false;
    services_.close();
    publishLastHealth();
    shutDown(mutex_, diagnostics_);
    cycles_.close();
}

void Introspection::watchHealth() {
    constexpr auto kPollPeriod = std::chrono::milliseconds(20);
    Clock::time_point due = Clock::now();
    for (; !stop_; std::this_thread::sleep_for(kPollPeriod)) {
        const std::lock_guard lock(mutex_);
        if (runner_.status().state == published_ && Clock::now() < due) continue;
        if (!diagnostics_) continue;
        publishHealth();
        due = Clock::now() + std::chrono::seconds(1);
    }
}

void Introspection::publishHealth() {
    published_ = runner_.status().state;
    diagnostic_msgs::DiagnosticArray array = report_.take();
    array.header.stamp = ros::Time::now();
    std::vector<std::uint8_t> bytes(ros::serialization::serializationLength(array));
    const auto size = static_cast<std::uint32_t>(bytes.size());
    ros::serialization::OStream stream(bytes.data(), size);
    ros::serialization::serialize(stream, array);
    try {
        diagnostics_.publish(RawView{bytes.data(), size, &departures_});
    } catch (const std::bad_alloc&) {  // the network memory is exhausted
        published_.reset();
    }
}

// Publishes the last state and waits until it is sent, because closing a topic drops queued
// messages.
void Introspection::publishLastHealth() {
    constexpr auto kPatience = std::chrono::milliseconds(500);
    constexpr auto kPause = std::chrono::milliseconds(1);
    std::unique_lock lock(mutex_);
    if (!diagnostics_) return;
    if (runner_.status().state != published_) publishHealth();
    const Departures::Until last = departures_.mark();
    const auto deadline = Clock::now() + kPatience;
    while (!departures_.gone(last) && Clock::now() < deadline) {
        lock.unlock();
        std::this_thread::sleep_for(kPause);
        lock.lock();
    }
}

}  // namespace rtcf::ros1
