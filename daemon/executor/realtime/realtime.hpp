/// @file
/// Real-time set-up of a process and its threads on Linux: locked memory, a prefaulted heap and
/// stack, SCHED_FIFO, a CPU of its own, and no deep idle states of the processor. Each failure is
/// reported in one line.
#pragma once

#include <pthread.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace rtcf::executor {

/// A missing prerequisite of real time.
struct RealtimeProblem {
    std::string text;        ///< one line
    bool essential = false;  ///< true = no real time without it; false = worse latency
};
using RealtimeProblems = std::vector<RealtimeProblem>;

/// Real-time settings of a loop.
struct RealtimeSettings {
    int cpu = -1;            ///< -1 = chosen, see CpuClaim
    unsigned priority = 80;  ///< SCHED_FIFO, 1 to 98
    bool wanted = true;      ///< false = an ordinary thread, for a simulated clock
    bool lock_memory = true;
    std::size_t heap_bytes = 8192 * 1024;  ///< heap to prefault
    std::size_t stack_bytes = 256 * 1024;  ///< stack of the real-time thread to prefault
};

/// Limits the heap to one arena that never shrinks, and sets small stacks for threads. At the
/// beginning of the process, before any thread.
void prepareProcess();

/// Locks all present and future memory, except tables for text conversion, and prefaults the heap.
/// @return missing prerequisites
RealtimeProblems lockMemory(const RealtimeSettings& settings);

/// Checks that threads may have the SCHED_FIFO priority of the settings, and that the kernel is
/// PREEMPT_RT.
/// @return missing prerequisites
RealtimeProblems checkScheduling(const RealtimeSettings& settings);

/// Attributes for pthread_create() of a real-time thread; without SCHED_FIFO if that is not
/// allowed. The settings must name a CPU.
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

/// Changes policy and CPU of a running thread. The settings must name a CPU.
/// @return missing prerequisites
RealtimeProblems applyToThread(pthread_t thread, const RealtimeSettings& settings);

/// Prefaults `bytes` of the calling thread's stack, so that the cycle has no page faults there.
void prefaultStack(std::size_t bytes);

/// Keeps the processor out of deep idle states for the life of this object, by writing 0 to
/// /dev/cpu_dma_latency (Linux Documentation/power/pm_qos_interface).
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
