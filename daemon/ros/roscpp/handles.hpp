/// @file
/// Handles of roscpp (ros::Publisher and its like) that one thread opens and closes while others
/// use them.
#pragma once

#include <chrono>
#include <mutex>
#include <utility>

namespace rtcf::ros1 {

/// Closes a handle that is used under a lock, without that lock: closing may wait for a callback
/// that takes it.
template <typename Handle>
void shutDown(std::mutex& mutex, Handle& handle) {
    Handle closing;
    {
        const std::lock_guard lock(mutex);
        std::swap(closing, handle);
    }
    closing.shutdown();
}

/// When what could not be opened is tried again. One thread at a time.
class Retry {
   public:
    /// It was opened, or not.
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
