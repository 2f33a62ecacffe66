#include "ros/transport/rejected_connections.hpp"

#include <string_view>
#include <utility>

namespace rtcf::ros1 {

RejectedConnections::RejectedConnections() { ros::console::register_appender(this); }

RejectedConnections::~RejectedConnections() { ros::console::deregister_appender(this); }

std::vector<std::string> RejectedConnections::take() {
    const std::lock_guard lock(mutex_);
    return std::exchange(fresh_, {});
}

std::string RejectedConnections::recent() const {
    const std::lock_guard lock(mutex_);
    const bool recent = std::chrono::steady_clock::now() - last_time_ < std::chrono::minutes(1);
    return recent ? last_ : std::string();
}

void RejectedConnections::log(ros::console::Level level, const char* text, const char* /*file*/,
                              const char* /*function*/, int /*line*/) {
    if (level < ros::console::levels::Error || text == nullptr) return;
    // This node is the publisher (first text) or the subscriber (second text) of a mismatched pair.
    const std::string_view view(text);
    if (view.find(" wants topic ") == std::string_view::npos &&
        view.find("error message in header") == std::string_view::npos) {
        return;
    }
    constexpr std::size_t kMost = 100;  // limits memory, as texts may contain changing numbers
    const std::lock_guard lock(mutex_);
    last_ = "a ROS connection was rejected: " + std::string(view);
    for (char& c : last_) {
        if (c == '\n') c = ' ';
    }
    last_time_ = std::chrono::steady_clock::now();
    if (known_.size() < kMost && known_.insert(last_).second) fresh_.push_back(last_);
}

}  // namespace rtcf::ros1
