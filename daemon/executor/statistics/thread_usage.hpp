/// @file
/// The kernel's counters of a thread of this process: proc(5), /proc/self/task/TID. Not real-time.
#pragma once

#include <cstdint>

namespace rtcf::executor {

struct ThreadUsage {
    std::uint64_t minor_faults = 0;
    std::uint64_t major_faults = 0;
    std::uint64_t involuntary_switches = 0;
};

/// @return all 0 if the thread does not exist
ThreadUsage readThreadUsage(int thread_id);

}  // namespace rtcf::executor
