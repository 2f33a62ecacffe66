/// @file
/// The processor's cycle counter as a thread finds it after a suspend of the machine: it has gone
/// on, or begun anew, while CLOCK_MONOTONIC stood still.
#pragma once

#include <cstdint>

namespace rtcf::test {

/// Traps the counter's readings (PR_SET_TSC(2const)); those of the clocks in the vdso stay right.
/// One at a time.
class ShiftedCounter {
   public:
    ShiftedCounter();
    ~ShiftedCounter();
    ShiftedCounter(const ShiftedCounter&) = delete;
    ShiftedCounter& operator=(const ShiftedCounter&) = delete;

    /// This machine can show it.
    static bool possible() noexcept;
    /// From here on, in the calling thread. @param ticks may be negative
    void shift(std::int64_t ticks) noexcept;
};

}  // namespace rtcf::test
