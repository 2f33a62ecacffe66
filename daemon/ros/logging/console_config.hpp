/// @file
/// ROSCONSOLE_CONFIG_FILE: a log4cxx properties file. Only the levels of loggers are used.
#pragma once

#include <string>

namespace rtcf::executor {
class Log;
}

namespace rtcf::ros1 {

/// Applies lines such as `log4j.logger.ros.rtcf.H1=DEBUG` and ignores others (appenders). Errors
/// are logged. Not real-time.
void applyConsoleConfig(const std::string& file, executor::Log& log);

}  // namespace rtcf::ros1
