/// @file
/// RTCF 2021's additions to OROCOS: node handles, and the loop's time. A second base class of
/// components that ORO_CREATE_COMPONENT registers.
#pragma once

#include <ros/ros.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string_view>

#include "rtcf/component.hpp"
#include "rtcf/ros.hpp"
#include "rtcf/rt_log_stream.hpp"
#include "rtcf/rt_logging_macros.hpp"
#include "rtcf/rt_rosconsole_logging.hpp"
#include "rtcf/test_logger.hpp"
#include "rtt/TaskContext.hpp"
#include "rtt/current_component.hpp"

class RtcfExtension {
   public:
    RtcfExtension() = default;
    virtual ~RtcfExtension() = default;
    RtcfExtension(const RtcfExtension&) = delete;
    RtcfExtension& operator=(const RtcfExtension&) = delete;

    /// @name For configureHook(), startHook(), stopHook() and cleanupHook(); not real-time safe
    /// The reference is valid as long as the component.
    /// @throws std::logic_error in the constructor
    /// @throws rtcf::NoMaster without a ROS master
    /// @{
    /// A handle whose relative names are in the component's namespace.
    ros::NodeHandle& getNodeHandle() const {
        return handle_.emplace(rtcf::nodeHandle(&component()));
    }
    /// A handle whose relative names are below the component's full name, as `~name` is for a node.
    ros::NodeHandle& getPrivateNodeHandle() const {
        return private_handle_.emplace(rtcf::privateNodeHandle(&component()));
    }
    /// @}

    /// @name In every hook; real-time safe
    /// @{
    /// ROS time of this cycle, the same for all components.
    ros::Time getTime() const {
        ros::Time time;
        time.fromNSec(static_cast<std::uint64_t>(component().stamp()));
        return time;
    }
    /// Cycles since the loop started.
    std::uint64_t getIteration() const { return component().iteration(); }
    /// The component's nominal frequency, Hz.
    double getFrequency() const { return component().frequency(); }
    /// @}

    /// @name Like the RT_ macros; real-time safe
    /// @{
    void rtLogDebug(std::string_view text) const { say(rtcf::LogLevel::Debug, text); }
    void rtLogInfo(std::string_view text) const { say(rtcf::LogLevel::Info, text); }
    void rtLogWarn(std::string_view text) const { say(rtcf::LogLevel::Warn, text); }
    void rtLogError(std::string_view text) const { say(rtcf::LogLevel::Error, text); }
    void rtLogFatal(std::string_view text) const { say(rtcf::LogLevel::Fatal, text); }
    /// A stream for one text: `rtLogStream(ros::console::levels::Info) << "force " << force;`
    rtcf::rtt_compat::LogStream rtLogStream(ros::console::Level level) const {
        return {speaker(), rtcf::rtt_compat::levelOf(level)};
    }
    /// @}

    /// For tests that construct a component themselves: sends its log to rosconsole, to the logger
    /// `ros.rtcf.<name>`. Does nothing in a loop, which has a log. Not real-time safe.
    /// @throws std::logic_error if the class is not an RTT::TaskContext
    void configureTestLogger() {
        auto* const task = dynamic_cast<RTT::TaskContext*>(this);
        if (task == nullptr) throw std::logic_error("configureTestLogger() needs a TaskContext");
        if (test_logger_ != nullptr || accessTo(*task).context().log != nullptr) return;
        test_logger_ = std::make_unique<rtcf::rtt_compat::TestLogger>(*task, task->getName());
        component_ = task;
        ROS_WARN("Component logger was set to non real-time safe test mode.");
    }

    /// Called by ORO_CREATE_COMPONENT after construction.
    friend void bindRtcfExtension(RtcfExtension& extension, const rtcf::Component& component) {
        extension.component_ = &component;
    }

   private:
    const rtcf::Component& component() const {
        if (component_ == nullptr) {
            throw std::logic_error(
                "RtcfExtension does not work in a constructor: use it from configureHook() on, in "
                "a component that ORO_CREATE_COMPONENT registers");
        }
        return *component_;
    }

    // The component that logs; constructors may log too.
    const rtcf::Component* speaker() const noexcept {
        if (component_ != nullptr) return component_;
        const rtcf::rtt_compat::HookSlot* const slot = rtcf::rtt_compat::hookSlot();
        return slot != nullptr ? slot->component : nullptr;
    }

    void say(rtcf::LogLevel level, std::string_view text) const {
        const rtcf::Component* const who = speaker();
        if (who == nullptr || !who->logs(level)) return;
        rtcf::rtt_compat::log(*who, rtcf::rtt_compat::logSite(level), text);
    }

    const rtcf::Component* component_ = nullptr;
    std::unique_ptr<rtcf::rtt_compat::TestLogger> test_logger_;
    // Made on demand, because a node handle needs a ROS node.
    mutable std::optional<ros::NodeHandle> handle_;
    mutable std::optional<ros::NodeHandle> private_handle_;
};
