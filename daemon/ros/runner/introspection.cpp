#include "ros/runner/introspection.hpp"

#include <ros/node_handle.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <utility>

#include "ros/roscpp/handles.hpp"
#include "ros/roscpp/quiet_thread.hpp"
#include "runner/runner.hpp"
#include "runner/runner_view.hpp"

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
    shutDown(mutex_, diagnostics_);
    cycles_.close();
}

void Introspection::watchHealth() {
    using Clock = std::chrono::steady_clock;
    constexpr auto kLook = std::chrono::milliseconds(20);
    executor::RunnerState published = executor::RunnerState::Stopped;
    Clock::time_point due = Clock::now();
    for (; !stop_; std::this_thread::sleep_for(kLook)) {
        const executor::RunnerState state = runner_.picture().state;
        if (state == published && Clock::now() < due) continue;
        const std::lock_guard lock(mutex_);
        if (!diagnostics_) continue;
        diagnostic_msgs::DiagnosticArray array = report_.take();
        array.header.stamp = ros::Time::now();
        diagnostics_.publish(array);
        published = state;
        due = Clock::now() + std::chrono::seconds(1);
    }
}

}  // namespace rtcf::ros1
