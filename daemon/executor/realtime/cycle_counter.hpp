/// @file
/// The processor's cycle counter, which takes one instruction to read and no system call. It
/// measures all durations in a cycle. The factor from ticks to ns is measured against
/// CLOCK_MONOTONIC.
#pragma once

#include <atomic>
#include <cstdint>
#include <ctime>

#include "rtcf/realtime.hpp"

namespace rtcf::executor {

/// CLOCK_MONOTONIC in ns; read in user space (vdso). Real-time safe.
inline std::int64_t monotonicNow() noexcept RTCF_NONBLOCKING {
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC, &now);
    return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

/// CLOCK_REALTIME in ns; read in user space (vdso). Real-time safe.
inline std::int64_t realtimeNow() noexcept RTCF_NONBLOCKING {
    timespec now{};
    clock_gettime(CLOCK_REALTIME, &now);
    return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

using ClockReading = std::int64_t (*)();

/// CLOCK_REALTIME minus CLOCK_MONOTONIC, ns. Uses the fastest of several readings, because the
/// thread may be preempted between the two clocks.
std::int64_t realtimeOffset(ClockReading monotonic = monotonicNow,
                            ClockReading realtime = realtimeNow) noexcept;

/// Ticks of the time stamp counter, or of the generic timer on arm64. Real-time safe.
inline std::int64_t readCycleCounter() noexcept RTCF_NONBLOCKING {
#if defined(__x86_64__)
    return static_cast<std::int64_t>(__builtin_ia32_rdtsc());
#elif defined(__aarch64__)
    std::int64_t ticks = 0;
    asm volatile("mrs %0, cntvct_el0" : "=r"(ticks));
    return ticks;
#else
    return monotonicNow();
#endif
}

/// Reads the counter into a word that other threads read. Real-time safe.
inline void noteCycleCounter(std::atomic<std::uint64_t>& word) noexcept RTCF_NONBLOCKING {
#if defined(__x86_64__) && !defined(__SANITIZE_THREAD__)
    // As the counter comes in two registers, this is the shortest way.
    using Half [[gnu::may_alias]] = std::uint32_t;
    auto* const halves = reinterpret_cast<Half*>(&word);
    asm volatile("rdtsc; movl %%eax, %0; movl %%edx, %1"
                 : "=m"(halves[0]), "=m"(halves[1])
                 :
                 : "rax", "rdx");
#else
    word.store(static_cast<std::uint64_t>(readCycleCounter()), std::memory_order_release);
#endif
}

/// Factors between ticks and ns.
class CycleCounter {
   public:
    /// Measures the factors, for about 20 ms. Not real-time safe.
    static CycleCounter calibrate();

    double nsPerTick() const noexcept { return ns_per_tick_; }
    /// Converts ticks to ns. Real-time safe.
    std::int64_t toNs(std::int64_t ticks) const noexcept RTCF_NONBLOCKING {
        return static_cast<std::int64_t>((static_cast<__int128>(ticks) * multiplier_) >> kShift);
    }

    /// Converts ns to ticks. Real-time safe.
    std::int64_t toTicks(std::int64_t ns) const noexcept RTCF_NONBLOCKING {
        return static_cast<std::int64_t>((static_cast<__int128>(ns) * inverse_) >> kShift);
    }

   private:
    static constexpr unsigned kShift = 32;
    double ns_per_tick_ = 1.0;
    std::int64_t multiplier_ = std::int64_t{1} << kShift;  // ns per tick, fixed point
    std::int64_t inverse_ = std::int64_t{1} << kShift;     // ticks per ns, fixed point
};

}  // namespace rtcf::executor
