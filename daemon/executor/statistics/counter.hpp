/// @file
/// Counters with one writer and any number of readers. Cheaper than fetch_add(), whose bus lock
/// only several writers need.
#pragma once

#include <atomic>
#include <cstdint>

#include "rtcf/realtime.hpp"

namespace rtcf::executor {

class Counter {
   public:
    /// Only by the writer. Real-time safe.
    void add(std::uint64_t by) noexcept RTCF_NONBLOCKING {
#if defined(__x86_64__) && !defined(__SANITIZE_THREAD__)
        // Same as the portable form, which compilers turn into three instructions.
        asm("addq %1, %0" : "+m"(value_) : "er"(by) : "cc");
#else
        value_.store(value_.load(std::memory_order_relaxed) + by, std::memory_order_relaxed);
#endif
    }

    /// While nobody calls add().
    void reset() noexcept { value_.store(0, std::memory_order_relaxed); }

    /// Any thread; real-time safe.
    std::uint64_t value() const noexcept RTCF_NONBLOCKING {
        return value_.load(std::memory_order_relaxed);
    }

   private:
    std::atomic<std::uint64_t> value_{0};
};

/// A counter of events, with their number since a reset of the statistics.
class EventCounter : public Counter {
   public:
    /// Lets recent() count from a value. One thread only, at any time.
    void restart(std::uint64_t from) noexcept { start_.store(from, std::memory_order_release); }
    /// Events since the last restart(). Any thread.
    std::uint64_t recent() const noexcept {
        // In this order, so that the difference is never negative.
        const std::uint64_t start = start_.load(std::memory_order_acquire);
        return value() - start;
    }

   private:
    std::atomic<std::uint64_t> start_{0};  // of the last restart()
};

}  // namespace rtcf::executor
