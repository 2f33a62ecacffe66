/// @file
/// CPU affinity of the other threads of this process: they stay off the loop's CPU if there is
/// another one. Threads that a component has pinned stay on their CPUs. Owned by the Loop; not
/// real-time, graph thread.
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

    /// Moves threads off `cpu`, and allows them the CPU of an earlier call again. Threads that they
    /// create inherit the CPUs.
    /// @param loop the loop's own thread; 0 = none yet
    void keepOff(int cpu, pid_t loop);
    /// Allows moved threads all CPUs of the process again.
    void release();

   private:
    void move(const cpu_set_t& to, pid_t loop);

    bool narrowed_ = false;   // threads have been moved off a CPU
    std::set<pid_t> pinned_;  // threads with other CPUs when threads were moved
};

}  // namespace rtcf::executor
