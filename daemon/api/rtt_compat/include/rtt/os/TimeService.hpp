/// @file
/// OROCOS' clock, for measuring durations. It is not the loop's clock: controllers compute with
/// getTime() and getPeriod(), which are also right in simulation.
#pragma once

#include <cstdint>
#include <ctime>

#include "rtt/Time.hpp"

namespace RTT::os {

/// The machine's clock. All functions are real-time safe: reading it needs no system call.
class TimeService {
   public:
    using ticks = std::int64_t;  ///< ns
    using nsecs = RTT::nsecs;
    using Seconds = RTT::Seconds;

    static TimeService* Instance() {
        static TimeService service;
        return &service;
    }
    /// Present time of CLOCK_MONOTONIC, ns.
    ticks getTicks() const noexcept {
        std::timespec now{};
        clock_gettime(CLOCK_MONOTONIC, &now);
        return static_cast<ticks>(now.tv_sec) * 1'000'000'000 + now.tv_nsec;
    }
    nsecs getNSecs() const noexcept { return getTicks(); }
    ticks ticksSince(ticks begin) const noexcept { return getTicks() - begin; }
    /// s
    Seconds secondsSince(ticks begin) const noexcept {
        return static_cast<Seconds>(ticksSince(begin)) * 1e-9;
    }
    /// Present time, s.
    Seconds getSeconds() const noexcept { return static_cast<Seconds>(getTicks()) * 1e-9; }

    static nsecs ticks2nsecs(ticks count) noexcept { return count; }
    static ticks nsecs2ticks(nsecs time) noexcept { return time; }
};

}  // namespace RTT::os

namespace RTT {
using os::TimeService;
}  // namespace RTT
