/// @file
/// The processor's cycle counter as seen by a thread after a suspend of the machine: it has
/// continued, or restarted, while CLOCK_MONOTONIC stood still.
#pragma once

#include <cstdint>

namespace rtcf::test {

/// Traps reads of the counter (PR_SET_TSC(2const)); the vdso's clocks stay correct. One at a
/// time.
class ShiftedCounter {
   public:
    ShiftedCounter();
    ~ShiftedCounter();
    ShiftedCounter(const ShiftedCounter&) = delete;
    ShiftedCounter& operator=(const ShiftedCounter&) = delete;

    /// Whether this machine supports it.
    static bool possible() noexcept;
    /// Shifts the counter from now on, in the calling thread. @param ticks may be negative
    void shift(std::int64_t ticks) noexcept;
};

}  // namespace rtcf::test
