/// @file
/// What makes a process and a thread real-time on Linux: locked memory, a
/// prefaulted heap and stack, SCHED_FIFO, a CPU of its own, no deep sleep of
/// the processor. Every part that the machine refuses is said in one line.
#pragma once

#include <pthread.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace rtcf::executor {

/// Something that is missing for real time.
struct RealtimeProblem {
    std::string text;        ///< one line
    bool essential = false;  ///< without it there is no real time; else it only becomes worse
};
using RealtimeProblems = std::vector<RealtimeProblem>;

/// What a loop wants of the machine.
struct RealtimeSettings {
    int cpu = -1;            ///< -1 = the last one that has no other loop; see CpuClaim
    unsigned priority = 80;  ///< SCHED_FIFO, 1 to 98
    bool wanted = true;      ///< false: an ordinary thread, for a simulated clock
    bool lock_memory = true;
    std::size_t heap_bytes = 8192 * 1024;
    std::size_t stack_bytes = 256 * 1024;
};

/// Limits the heap to one arena that never shrinks and gives threads small
/// stacks. At the beginning of the process, before any thread.
void prepareProcess();

/// Locks all memory, present and future, but tables that only text conversion reads, and touches
/// the heap.
RealtimeProblems lockMemory(const RealtimeSettings& settings);

/// Whether threads may have the settings' SCHED_FIFO priority, and whether the kernel is one for
/// real time.
RealtimeProblems checkScheduling(const RealtimeSettings& settings);

/// Attributes of a real-time thread's pthread; without SCHED_FIFO where that is not allowed. The
/// settings name a CPU.
class RealtimeAttributes {
   public:
    explicit RealtimeAttributes(const RealtimeSettings& settings);
    ~RealtimeAttributes() { pthread_attr_destroy(&attributes_); }
    RealtimeAttributes(const RealtimeAttributes&) = delete;
    RealtimeAttributes& operator=(const RealtimeAttributes&) = delete;
    const pthread_attr_t* get() const noexcept { return &attributes_; }

   private:
    pthread_attr_t attributes_{};
};

/// Changes policy and CPU of a running thread. The settings name a CPU.
RealtimeProblems applyToThread(pthread_t thread, const RealtimeSettings& settings);

/// Touches `bytes` of the calling thread's stack, so that the cycle takes no page fault there.
void prefaultStack(std::size_t bytes);

/// Keeps the processor out of deep idle states while it lives (Linux
/// Documentation/power/pm_qos_interface: /dev/cpu_dma_latency held at 0).
class IdleStateGuard {
   public:
    IdleStateGuard();
    ~IdleStateGuard();
    IdleStateGuard(const IdleStateGuard&) = delete;
    IdleStateGuard& operator=(const IdleStateGuard&) = delete;
    const std::string& problem() const noexcept { return problem_; }

   private:
    int fd_ = -1;
    std::string problem_;
};

}  // namespace rtcf::executor
