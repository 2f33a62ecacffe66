/// @file
/// Logs the errors of work that must not end a thread.
#pragma once

#include <functional>

#include "logging/log.hpp"

namespace rtcf::executor {

/// Runs `work`, and writes its exception to the log, so that no error ends a process whose loop
/// runs. Not real-time.
/// @param what subject of the message, e.g. "a change"
void logErrors(Log& log, const char* what, const std::function<void()>& work) noexcept;

}  // namespace rtcf::executor
