/// @file
/// The backend of rosconsole in this process. Messages of ROS_* macros, in components' hooks, their
/// callbacks and roscpp itself, go into the executor's log, with its levels. It replaces the
/// log4cxx backend: that of Debian 12 crashes after a query of the loggers. So roscpp's services
/// ~get_loggers and ~set_logger_level end here.
#pragma once

#include <ros/console.h>

#include <string>

#include "logging/log.hpp"

namespace rtcf::ros1 {

/// One object per process, like rosconsole; without one, nothing is logged. Any thread.
class ConsoleBackend {
   public:
    /// Copies the levels of ROSCONSOLE_CONFIG_FILE to `log`.
    /// @param log outlives this object
    explicit ConsoleBackend(executor::Log& log);
    ~ConsoleBackend();
    ConsoleBackend(const ConsoleBackend&) = delete;
    ConsoleBackend& operator=(const ConsoleBackend&) = delete;

    /// @name Called by rosconsole
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
