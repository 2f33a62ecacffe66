/// @file
/// The CPU of a real-time loop. Loops on one CPU delay each other. A loop without a fixed CPU takes
/// one that no other loop with the same claims folder uses, or else one with the fewest loops. It
/// also learns whether other loops used the CPU before. A claim is a locked file in a folder that
/// only the executors' user can write, so that other users cannot influence the choice. The kernel
/// releases the lock however the process ends. Not real-time; graph thread.
#pragma once

#include <sched.h>

#include <string>
#include <vector>

namespace rtcf::executor {

/// The CPUs that this process was started with, in order. Its threads may be restricted since.
const std::vector<int>& processCpus();

/// CPUs for a loop without a fixed CPU, best first: isolated CPUs, where the kernel schedules
/// nothing else, then the others. Both from the last one down, because the first ones serve
/// interrupts.
/// @param isolated text of /sys/devices/system/cpu/isolated, e.g. "2-3,6"
std::vector<int> byPreference(const std::vector<int>& cpus, const std::string& isolated);

class CpuClaim {
   public:
    /// @param wanted CPU; -1 = the best one of this process's CPUs with the fewest loops
    /// @param folder folder of the claims; if it is empty or cannot be written, other loops are
    /// ignored
    CpuClaim(int wanted, std::string folder);
    ~CpuClaim();
    CpuClaim(const CpuClaim&) = delete;
    CpuClaim& operator=(const CpuClaim&) = delete;

    int cpu() const noexcept { return cpu_; }
    /// True if no other loop is known to use this CPU.
    bool alone() const noexcept { return place_ <= 0; }

   private:
    bool take(int cpu, int place);

    std::string folder_;
    std::string file_;  // locked claim file
    int cpu_ = -1;
    int place_ = -1;  // index among the loops of the CPU; -1 = unknown
    int fd_ = -1;
};

}  // namespace rtcf::executor
