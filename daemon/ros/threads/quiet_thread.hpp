/// @file
/// Threads that do not handle the process's signals, which the main thread receives.
#pragma once

#include <functional>
#include <thread>

namespace rtcf::ros1 {

/// Starts a thread with all signals blocked, except those of faults. Threads that it creates, such
/// as roscpp's, inherit the mask.
/// @param name name in ps and top, at most 15 characters
std::thread quietThread(const char* name, std::function<void()> body);

}  // namespace rtcf::ros1
