/// @file
/// The CPU of a real-time loop. Loops on one CPU would wait for each other: one that may choose
/// takes a CPU that no other loop of this machine has, and each knows whether it is alone. Not
/// real-time; graph thread.
#pragma once

#include <sched.h>

#include <string>
#include <vector>

namespace rtcf::executor {

/// The CPUs that this process was started with, in order. Threads of it may have fewer since.
const std::vector<int>& processCpus();

/// Keeps all threads of this process off a CPU where there is another one, but for one thread.
/// Threads that are made later by those inherit it. @param except 0 = none
void keepThreadsOff(int cpu, int except);

class CpuClaim {
   public:
    /// @param wanted -1 = the last CPU of this process that no other loop has; the last, if each
    /// has one
    /// @param names in the abstract namespace of sockets, which the kernel clears when a process
    /// ends, however it does
    explicit CpuClaim(int wanted, std::string names = "rtcf-loop-cpu");
    ~CpuClaim();
    CpuClaim(const CpuClaim&) = delete;
    CpuClaim& operator=(const CpuClaim&) = delete;

    int cpu() const noexcept { return cpu_; }
    /// No other loop has this CPU.
    bool alone() const noexcept { return fd_ >= 0; }

   private:
    bool take(int cpu);

    std::string names_;
    int cpu_ = -1;
    int fd_ = -1;
};

}  // namespace rtcf::executor
