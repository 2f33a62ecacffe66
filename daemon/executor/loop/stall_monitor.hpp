/// @file
/// Monitors the progress of a running loop. If a component never returns from update(), the process
/// ends, and rtcfd starts a new one without the component.
#pragma once

#include <atomic>
#include <cstdint>
#include <thread>

namespace rtcf::executor {

class Loop;

/// Runs a thread, SCHED_OTHER. If the real-time thread takes all of the only CPU, this thread
/// cannot run; then the handler of SIGXCPU, caused by RLIMIT_RTTIME, makes the same check.
class StallMonitor {
   public:
    /// @param loop outlives the monitor
    explicit StallMonitor(const Loop& loop);
    ~StallMonitor();
    StallMonitor(const StallMonitor&) = delete;
    StallMonitor& operator=(const StallMonitor&) = delete;

    /// Ends the process after `timeout_ns` without progress; 0 = never. Any thread.
    void setTimeout(std::int64_t timeout_ns);

   private:
    void threadMain();

    const Loop& loop_;
    std::atomic<std::int64_t> timeout_ns_{0};
    std::atomic<bool> ending_{false};
    std::thread thread_;
};

}  // namespace rtcf::executor
