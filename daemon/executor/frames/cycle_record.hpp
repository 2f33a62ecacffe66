/// @file
/// Record of a cycle.
#pragma once

#include <cstdint>

namespace rtcf::executor {

/// One executed cycle.
struct CycleRecord {
    std::uint64_t iteration;
    std::int64_t stamp_ns;     ///< CLOCK_REALTIME of the deadline, or the simulated clock's time
    std::int64_t latency_ns;   ///< wake-up minus deadline; may be negative
    std::int64_t duration_ns;  ///< from the wake-up to the end of the cycle
};

}  // namespace rtcf::executor
