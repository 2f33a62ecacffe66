/// @file
/// Waits for another thread's action, with a deadline.
#pragma once

#include <chrono>
#include <functional>
#include <thread>

namespace rtcf::test {

/// Polls `condition` for at most a minute. @return whether it became true
inline bool eventually(const std::function<bool()>& condition) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(1);
    while (!condition()) {
        if (std::chrono::steady_clock::now() > deadline) return false;
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return true;
}

}  // namespace rtcf::test
