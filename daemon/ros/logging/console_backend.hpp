/// @file
/// The backend of rosconsole in this process: what is said by ROS_* macros,
/// in components' hooks, their callbacks and roscpp itself, goes into our log,
/// and the levels are those of our log. It takes the place of the log4cxx
/// backend, of which Debian 12's crashes once somebody has asked for the
/// loggers: roscpp's services ~get_loggers and ~set_logger_level end here.
#pragma once

#include <ros/console.h>

#include <string>

#include "logging/log.hpp"

namespace rtcf::ros1 {

/// One at a time in a process, as rosconsole is; without one, nothing is logged. Any thread.
class ConsoleBackend {
   public:
    /// Takes the levels of ROSCONSOLE_CONFIG_FILE over into `log`, which outlives this.
    explicit ConsoleBackend(executor::Log& log);
    ~ConsoleBackend();
    ConsoleBackend(const ConsoleBackend&) = delete;
    ConsoleBackend& operator=(const ConsoleBackend&) = delete;

    /// @name What rosconsole asks for
    /// @{
    bool enabled(const std::string& logger, LogLevel level) const;
    void print(const std::string& logger, LogLevel level, const char* text, const char* file,
               const char* function, int line);
    executor::LogLevels& levels() const { return log_.levels(); }
    /// @}

   private:
    executor::Log& log_;
};

}  // namespace rtcf::ros1
