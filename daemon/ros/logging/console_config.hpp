/// @file
/// ROSCONSOLE_CONFIG_FILE: a log4cxx properties file, of which the levels of
/// loggers count here.
#pragma once

#include <string>

namespace rtcf::executor {
class Log;
}

namespace rtcf::ros1 {

/// Takes lines such as `log4j.logger.ros.rtcf.H1=DEBUG` over; others (appenders) are passed over.
/// What cannot be read or understood is logged. Not real-time.
void applyConsoleConfig(const std::string& file, executor::Log& log);

}  // namespace rtcf::ros1
