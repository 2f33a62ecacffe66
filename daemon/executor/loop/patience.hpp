/// @file
/// A limit of the time that a thread waits for another one.
#pragma once

#include <time.h>

#include <algorithm>
#include <cstdint>
#include <utility>

#include "common/time_units.hpp"
#include "realtime/cycle_counter.hpp"

namespace rtcf::executor {

/// Time left for a wait that looks for its end again and again. A freeze of the machine, however
/// long, uses up a tenth of a second: the other thread was frozen, too, and may run later.
/// Not real-time.
class Patience {
   public:
    explicit Patience(std::int64_t time_ns) : left_ns_(time_ns) {}

    /// Sleeps for a moment.
    /// @return false if no time is left
    bool wait() noexcept {
        const timespec moment{0, 100'000};
        nanosleep(&moment, nullptr);
        const std::int64_t now = monotonicNow();
        left_ns_ -= std::min(now - std::exchange(last_ns_, now), kMostCounted);
        return left_ns_ > 0;
    }

   private:
    static constexpr std::int64_t kMostCounted = kSecond / 10;

    std::int64_t left_ns_;
    std::int64_t last_ns_ = monotonicNow();
};

}  // namespace rtcf::executor
