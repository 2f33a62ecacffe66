/// @file
/// Helpers for handles of roscpp (e.g. ros::Publisher) that one thread opens and closes while
/// others use them.
#pragma once

#include <chrono>
#include <mutex>
#include <utility>

namespace rtcf::ros1 {

/// Closes a handle that is protected by a mutex, without holding the mutex: closing may wait for a
/// callback that takes it.
template <typename Handle>
void shutDown(std::mutex& mutex, Handle& handle) {
    Handle closing;
    {
        const std::lock_guard lock(mutex);
        std::swap(closing, handle);
    }
    closing.shutdown();
}

/// Delay before the next attempt to open something. One thread at a time.
class Retry {
   public:
    /// Records the result of an attempt.
    void note(bool opened) {
        constexpr auto kPause = std::chrono::seconds(2);
        next_ = opened ? Clock::time_point{} : Clock::now() + kPause;
    }
    bool due() const { return Clock::now() >= next_; }

   private:
    using Clock = std::chrono::steady_clock;
    Clock::time_point next_;
};

}  // namespace rtcf::ros1
