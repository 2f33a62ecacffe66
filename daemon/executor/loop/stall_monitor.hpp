/// @file
/// Watches a running loop for progress. A component that never returns from
/// update() cannot be helped from inside: the process ends, and rtcfd begins
/// anew without it.
#pragma once

#include <atomic>
#include <cstdint>
#include <thread>

namespace rtcf::executor {

class Loop;

/// A thread of its own, SCHED_OTHER. For a real-time thread that takes all of
/// the only CPU there is RLIMIT_RTTIME besides, whose SIGXCPU asks the same
/// question.
class StallMonitor {
   public:
    /// @param loop outlives the monitor
    explicit StallMonitor(const Loop& loop);
    ~StallMonitor();
    StallMonitor(const StallMonitor&) = delete;
    StallMonitor& operator=(const StallMonitor&) = delete;

    /// Ends the process after so long without progress; 0 = never. Any thread.
    void setTimeout(std::int64_t timeout_ns);

   private:
    void threadMain();

    const Loop& loop_;
    std::atomic<std::int64_t> timeout_ns_{0};
    std::atomic<bool> ending_{false};
    std::thread thread_;
};

}  // namespace rtcf::executor
