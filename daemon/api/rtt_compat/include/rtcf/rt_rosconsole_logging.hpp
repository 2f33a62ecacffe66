/// @file
/// RTCF 2021's way to set a logger's level from a component. Records go to ROS by the runner, so
/// that there is nothing else in it.
#pragma once

#include <ros/console.h>

#include <string>

class RtRosconsoleLogging {
   public:
    RtRosconsoleLogging() = delete;

    /// Sets the level of a logger, e.g. "ros.rtcf./arm/H1", for the whole loop. Not real-time safe.
    /// @return false if there is no such level, or no loop
    static bool setLoggerLevel(const std::string& name, ros::console::levels::Level level) {
        if (!ros::console::set_logger_level(name, level)) return false;
        ros::console::notifyLoggerLevelsChanged();
        return true;
    }
};
