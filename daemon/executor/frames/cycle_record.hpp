/// @file
/// What is noted of every cycle.
#pragma once

#include <cstdint>

namespace rtcf::executor {

/// One executed cycle.
struct CycleRecord {
    std::uint64_t iteration;
    std::int64_t stamp_ns;     ///< CLOCK_REALTIME of the deadline, or the simulated clock's time
    std::int64_t latency_ns;   ///< wake-up after the deadline; may be negative
    std::int64_t duration_ns;  ///< calculation
};

}  // namespace rtcf::executor
