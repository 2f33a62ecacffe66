/// @file
/// The CPU of a real-time loop. Loops on one CPU wait for each other: one that may choose takes a
/// CPU that no other loop with the same folder of claims has, or else one of those that the fewest
/// have, and knows whether it was alone there when it came. A claim is a locked file in a folder
/// where only the executors' user writes, so that nobody else moves a loop; the kernel unlocks it
/// however a process ends. Not real-time; graph thread.
#pragma once

#include <sched.h>

#include <string>
#include <vector>

namespace rtcf::executor {

/// The CPUs that this process was started with, in order. Threads of it may have fewer since.
const std::vector<int>& processCpus();

/// CPUs for a loop that may choose, the best first: those that are isolated (nothing else is
/// scheduled there), then the others, each from the last on: the first ones serve interrupts.
/// @param isolated as in /sys/devices/system/cpu/isolated: "2-3,6"
std::vector<int> byPreference(const std::vector<int>& cpus, const std::string& isolated);

class CpuClaim {
   public:
    /// @param wanted -1 = of all CPUs of this process the best of those with the fewest loops
    /// @param folder of the claims; empty, or one that cannot be written to: other loops are not
    /// known of
    CpuClaim(int wanted, std::string folder);
    ~CpuClaim();
    CpuClaim(const CpuClaim&) = delete;
    CpuClaim& operator=(const CpuClaim&) = delete;

    int cpu() const noexcept { return cpu_; }
    /// No other loop is known to have had this CPU before.
    bool alone() const noexcept { return place_ <= 0; }

   private:
    bool take(int cpu, int place);

    std::string folder_;
    std::string file_;  // that is locked
    int cpu_ = -1;
    int place_ = -1;  // among the loops of that CPU; -1 = nobody knows
    int fd_ = -1;
};

}  // namespace rtcf::executor
