/// @file
/// The threads of this process beside a loop's: they keep off its CPU where there is another.
/// Threads that a component has pinned to other CPUs than those of the process stay there. Owned by
/// the Loop; not real-time, graph thread.
#pragma once

#include <sched.h>
#include <sys/types.h>

#include <set>

namespace rtcf::executor {

/// The threads of this process.
std::set<pid_t> processThreads();

class OtherThreads {
   public:
    OtherThreads() = default;
    OtherThreads(const OtherThreads&) = delete;
    OtherThreads& operator=(const OtherThreads&) = delete;

    /// Moves threads off the CPU, and those that had to keep off an earlier one back to that.
    /// Threads that they make later inherit it. @param loop the loop's own thread; 0 = none yet
    void keepOff(int cpu, pid_t loop);
    /// Those that keep off a CPU may use all of the process again.
    void release();

   private:
    void move(const cpu_set_t& to, pid_t loop);

    bool narrowed_ = false;   // threads keep off a CPU
    std::set<pid_t> pinned_;  // threads that were not there when others were moved
};

}  // namespace rtcf::executor
