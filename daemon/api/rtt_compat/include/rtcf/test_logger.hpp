/// @file
/// Log of a component that a test constructs without a loop.
#pragma once

#include <ros/console.h>

#include <map>
#include <mutex>
#include <string>

#include "rtcf/component.hpp"

namespace rtcf::rtt_compat {

/// Context of a component without a loop: a name, a stopped clock, and a log that writes to
/// rosconsole at once. Owned by the component's RtcfExtension. Not real-time safe.
class TestLogger final : public LogSink {
   public:
    /// @param component has no loop; outlives this object
    TestLogger(Component& component, const std::string& name) {
        context_.full_name = "/" + name;
        context_.name = name;
        context_.clock = &clock_;
        context_.period_ns = clock_.period_ns;
        context_.log = this;
        context_.log_level = LogLevel::Debug;  // rosconsole decides
        accessTo(component).attach(context_);
    }
    TestLogger(const TestLogger&) = delete;
    TestLogger& operator=(const TestLogger&) = delete;

    LogRecord* claim() noexcept override {
        mutex_.lock();
        return &record_;
    }
    void commit(LogRecord* record) noexcept override {
        std::string text;
        record->render(*record, text);
        const auto level =
            static_cast<ros::console::Level>(static_cast<int>(record->site->level) - 1);
        mutex_.unlock();
        const ros::console::LogLocation location = locationOf("ros.rtcf." + context_.name, level);
        if (!location.logger_enabled_) return;
        ros::console::print(nullptr, location.logger_, level, __FILE__, __LINE__, __func__, "%s",
                            text.c_str());
    }

   private:
    // Like the location in ROS_LOG, but one per logger. rosconsole keeps the addresses for ever.
    static ros::console::LogLocation locationOf(const std::string& logger,
                                                ros::console::Level level) {
        ROSCONSOLE_AUTOINIT;
        static std::mutex mutex;
        static auto& locations = *new std::map<std::string, ros::console::LogLocation>;
        const std::lock_guard<std::mutex> lock(mutex);
        ros::console::LogLocation& location = locations[logger];
        if (!location.initialized_) ros::console::initializeLogLocation(&location, logger, level);
        ros::console::setLogLocationLevel(&location, level);
        ros::console::checkLogLocationEnabled(&location);
        return location;
    }

    LoopClock clock_;
    ComponentContext context_;
    std::mutex mutex_;  // locked from claim() to commit()
    LogRecord record_{};
};

}  // namespace rtcf::rtt_compat
