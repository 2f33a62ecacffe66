// Logs in every possible way, from each thread in which it may run.
#include <ros/console.h>

#include <rtcf/component.hpp>

namespace {

class Speaker final : public rtcf::Component {
    bool configure() override {
        ROS_INFO("by macro at %d", 1);
        ROS_DEBUG("by macro, for those who debug");
        RTCF_INFO(this, "by rtcf at {}", 1);
        return true;
    }
    void update() override {
        RTCF_WARN_ONCE(this, "in the cycle");
        RTCF_DEBUG(this, "each cycle");
    }
};

}  // namespace

RTCF_COMPONENT(Speaker, "Logs in every possible way")
