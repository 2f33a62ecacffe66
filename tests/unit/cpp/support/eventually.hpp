/// @file
/// Waiting for what another thread does, with a deadline.
#pragma once

#include <chrono>
#include <functional>
#include <thread>

namespace rtcf::test {

/// Asks until it is so, for at most a minute. @return whether it came to be
inline bool eventually(const std::function<bool()>& condition) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(1);
    while (!condition()) {
        if (std::chrono::steady_clock::now() > deadline) return false;
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return true;
}

}  // namespace rtcf::test
