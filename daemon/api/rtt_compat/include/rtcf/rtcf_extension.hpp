/// @file
/// What RTCF 2021 gives a component beside OROCOS: node handles, and the loop's
/// time. A second base class of components that ORO_CREATE_COMPONENT registers.
#pragma once

#include <ros/ros.h>

#include <array>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string_view>

#include "rtcf/component.hpp"
#include "rtcf/ros.hpp"
#include "rtcf/rt_logging_macros.hpp"
#include "rtt/current_component.hpp"

class RtcfExtension {
   public:
    RtcfExtension() = default;
    virtual ~RtcfExtension() = default;
    RtcfExtension(const RtcfExtension&) = delete;
    RtcfExtension& operator=(const RtcfExtension&) = delete;

    /// @name For configureHook(), startHook(), stopHook() and cleanupHook(); not real-time safe
    /// The reference stays good as long as the component. @throws std::logic_error in the
    /// constructor, rtcf::NoMaster without a ROS master
    /// @{
    /// Relative names are in the component's namespace.
    ros::NodeHandle& getNodeHandle() const {
        return handle_.emplace(rtcf::nodeHandle(&component()));
    }
    /// Relative names are below the component's own name, as `~name` of a node.
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

    /// @name As the RT_ macros, which once were made of these
    /// @{
    void rtLogDebug(std::string_view text) const { say(rtcf::LogLevel::Debug, text); }
    void rtLogInfo(std::string_view text) const { say(rtcf::LogLevel::Info, text); }
    void rtLogWarn(std::string_view text) const { say(rtcf::LogLevel::Warn, text); }
    void rtLogError(std::string_view text) const { say(rtcf::LogLevel::Error, text); }
    void rtLogFatal(std::string_view text) const { say(rtcf::LogLevel::Fatal, text); }
    /// @}

    /// By ORO_CREATE_COMPONENT, after construction.
    friend void bindRtcfExtension(RtcfExtension& extension, const rtcf::Component& component) {
        extension.component_ = &component;
    }

   private:
    const rtcf::Component& component() const {
        if (component_ == nullptr) {
            throw std::logic_error(
                "RtcfExtension is of no use in a constructor: use it from configureHook() on, in a "
                "component that ORO_CREATE_COMPONENT registers");
        }
        return *component_;
    }

    void say(rtcf::LogLevel level, std::string_view text) const {
        static constexpr auto at = [](rtcf::LogLevel of) {
            return rtcf::LogSite{of, "", 0, "rtLog", "{}"};
        };
        static constexpr std::array<rtcf::LogSite, 5> kSites{
            at(rtcf::LogLevel::Debug), at(rtcf::LogLevel::Info), at(rtcf::LogLevel::Warn),
            at(rtcf::LogLevel::Error), at(rtcf::LogLevel::Fatal)};
        // Constructors may log too.
        const rtcf::rtt_compat::HookSlot* const slot = rtcf::rtt_compat::hookSlot();
        const rtcf::Component* who = component_;
        if (who == nullptr && slot != nullptr) who = slot->component;
        if (who == nullptr || !who->logs(level)) return;
        rtcf::rtt_compat::log(*who, kSites.at(static_cast<std::size_t>(level) - 1), text);
    }

    const rtcf::Component* component_ = nullptr;
    // Not before they are asked for: a node handle needs a node.
    mutable std::optional<ros::NodeHandle> handle_;
    mutable std::optional<ros::NodeHandle> private_handle_;
};
