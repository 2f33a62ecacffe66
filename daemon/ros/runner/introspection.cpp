#include "ros/runner/introspection.hpp"

#include <ros/node_handle.h>
#include <unistd.h>

#include <array>

namespace rtcf::ros1 {

namespace {

std::string hostName() {
    std::array<char, 256> name{};
    return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "";
}

}  // namespace

Introspection::Introspection(executor::RunnerView& runner, const executor::AskSupervisor& ask,
                             executor::Log& log)
    : cycles_(runner), report_(runner, hostName()), services_(runner, ask, log) {}

void Introspection::open(ros::NodeHandle& handle, const std::string& name_space) {
    if (open_ && name_space == name_space_) return;
    close();
    open_ = true;
    name_space_ = name_space;
    cycles_.open(handle, name_space);
    diagnostics_ = handle.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10);
    services_.open(handle, name_space);
}

void Introspection::close() {
    if (!open_) return;
    open_ = false;
    services_.close();
    diagnostics_.shutdown();
    cycles_.close();
}

void Introspection::publishDiagnostics() {
    if (!open_ || std::chrono::steady_clock::now() < due_) return;
    // The watch comes by twice a second.
    due_ = std::chrono::steady_clock::now() + std::chrono::milliseconds(900);
    diagnostic_msgs::DiagnosticArray array = report_.take();
    array.header.stamp = ros::Time::now();
    diagnostics_.publish(array);
}

}  // namespace rtcf::ros1
