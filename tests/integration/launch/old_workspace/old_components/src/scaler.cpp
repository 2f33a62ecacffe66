#include <ros/ros.h>
#include <old_components/scaler.hpp>
#include <rtcf/rt_logging_macros.hpp>
#include <rtt/Component.hpp>
#include <rtt/Logger.hpp>

namespace old {

Scaler::Scaler(const std::string& name) : TaskContext(name), in_("in"), out_("out") {
    RT_INFO("constructed");
}

bool Scaler::configureHook() {
    ports()->addPort(in_);
    ports()->addPort(out_);
    getPrivateNodeHandle().getParam("factor", factor_);
    NON_RT_INFO("scaling by %g", factor_);
    return true;
}

void Scaler::updateHook() {
    std_msgs::Float64 value;
    if (in_.read(value) == RTT::NoData) return;
    msg_.value.data = value.data * factor_;
    msg_.factor = factor_;
    out_.write(msg_);
}

void Scaler::stopHook() { RTT::log(RTT::Info) << "stopped" << RTT::endlog(); }

void Scaler::cleanupHook() { NON_RT_INFO("cleaned up"); }

}  // namespace old

ORO_CREATE_COMPONENT(old::Scaler)
