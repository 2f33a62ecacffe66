/// @file
/// Threads that leave the process's signals to the thread that waits for them.
#pragma once

#include <functional>
#include <thread>

namespace rtcf::ros1 {

/// Starts a thread with all signals blocked but those that a fault raises in
/// it; threads that it creates, such as roscpp's, inherit that.
/// @param name shown by ps and top, at most 15 characters
std::thread quietThread(const char* name, std::function<void()> body);

}  // namespace rtcf::ros1
