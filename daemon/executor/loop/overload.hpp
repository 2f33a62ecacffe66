/// @file
/// Sheds the load of a loop whose cycles take longer than its period. Such a loop never sleeps, and
/// nothing else runs on its CPU: not the command that would stop it, and on a machine of one CPU
/// not even the change that would make it faster.
#pragma once

#include <algorithm>
#include <cstdint>

#include "common/time_units.hpp"
#include "rtcf/realtime.hpp"

namespace rtcf::executor {

/// Decides how long the loop rests after a cycle. Late cycles, each with the sleep before it, may
/// keep the loop awake for three quarters of the time. If they do so for longer, in all about a
/// second more, the loop rests after a late cycle as long as that cycle took. So a quarter of the
/// CPU is free, and cycles in time never lead to a rest.
///
/// By default, the kernel limits all real-time threads of a CPU to 95 % (sched(7), at
/// sched_rt_runtime_us), and stops a loop in the middle of a cycle. This limit is reached first.
class Overload {
   public:
    /// Longest rest after a cycle, ns: the loop sees a request to stop only after it.
    static constexpr std::int64_t kLongestRest = kSecond;

    /// Notes the end of a cycle. Real-time safe.
    /// @param wake_ns, end_ns times at which the loop woke up for the cycle, and ended it
    /// @param late the next cycle should have begun by then
    /// @return the rest after this cycle, ns
    std::int64_t rest(std::int64_t wake_ns, std::int64_t end_ns, bool late) noexcept
        RTCF_NONBLOCKING {
        // One freeze of the machine, however long, is not an overload.
        constexpr std::int64_t kLongestCounted = kSecond / 10;
        const std::int64_t awake = end_ns - wake_ns;
        const std::int64_t asleep = std::min(wake_ns - last_end_ns_, kLongestCounted);
        last_end_ns_ = end_ns;
        allowance_ns_ += asleep;
        if (late) allowance_ns_ -= (std::min(awake, kLongestCounted) + asleep) / 4;
        allowance_ns_ = std::clamp(allowance_ns_, -kAllowance, kAllowance);
        return late && allowance_ns_ < 0 ? std::min(awake, kLongestRest) : 0;
    }

   private:
    // A loop that is always awake uses it up in a second.
    static constexpr std::int64_t kAllowance = kSecond / 4;

    std::int64_t last_end_ns_ = 0;
    std::int64_t allowance_ns_ = kAllowance;
};

}  // namespace rtcf::executor
