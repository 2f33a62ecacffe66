/// @file
/// RTCF 2021's class for setting a logger's level from a component. The runner sends records to
/// ROS, so this class does nothing else.
#pragma once

#include <ros/console.h>

#include <string>

class RtRosconsoleLogging {
   public:
    RtRosconsoleLogging() = delete;

    /// Sets the level of a logger, e.g. "ros.rtcf./arm/H1", in the whole executor. Not real-time
    /// safe.
    /// @return false if there is no such level, or no executor
    static bool setLoggerLevel(const std::string& name, ros::console::levels::Level level) {
        if (!ros::console::set_logger_level(name, level)) return false;
        ros::console::notifyLoggerLevelsChanged();
        return true;
    }
};
