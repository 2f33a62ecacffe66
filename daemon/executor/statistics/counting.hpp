/// @file
/// Consistency of statistics: decides whether the running cycle is counted, so that statistics can
/// be reset at one instant. Between two counted cycles, all statistics are of the same cycles; a
/// reader can check that no cycle was counted while it copied (a sequence lock). A loop that is
/// late leaves no time between cycles. A reader then excludes cycles from counting for a while, and
/// the loop never waits.
#pragma once

#include <atomic>
#include <cstdint>

#include "rtcf/realtime.hpp"

namespace rtcf::executor {

class Counting {
   public:
    /// Scope of one cycle, from before its first count to after its overrun is counted. Cycle
    /// thread; real-time safe.
    class Turn {
       public:
        explicit Turn(Counting& counting) noexcept RTCF_NONBLOCKING : counting_(counting) {
            counting_.begin();
        }
        ~Turn() RTCF_NONBLOCKING { counting_.end(); }
        Turn(const Turn&) = delete;
        Turn& operator=(const Turn&) = delete;

       private:
        Counting& counting_;
    };

    /// True if the present cycle is counted. Cycle thread, within a Turn. Real-time safe.
    bool counts() const noexcept RTCF_NONBLOCKING { return counts_; }

    /// @name One other thread
    /// @{
    /// Excludes cycles that begin from here on, until release().
    void hold() noexcept { held_.store(true, std::memory_order_relaxed); }
    void release() noexcept { held_.store(false, std::memory_order_relaxed); }
    /// Calls `copy`, which copies the statistics.
    /// @return false if a cycle was being counted meanwhile, so that the copy may be inconsistent
    template <typename Copy>
    bool read(Copy&& copy) const {
        const std::uint64_t turn = turn_.load(std::memory_order_acquire);
        if (turn % 2 != 0) return false;
        copy();
        fence(std::memory_order_acquire);
        return turn_.load(std::memory_order_relaxed) == turn;
    }
    /// @}

   private:
    void begin() noexcept RTCF_NONBLOCKING {
        counts_ = !held_.load(std::memory_order_relaxed);
        if (!counts_) return;
        turn_.store(turn_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
        fence(std::memory_order_release);
    }
    void end() noexcept RTCF_NONBLOCKING {
        if (!counts_) return;
        counts_ = false;
        turn_.store(turn_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
    }
    static void fence(std::memory_order order) noexcept RTCF_NONBLOCKING {
#if defined(__SANITIZE_THREAD__)
        // ThreadSanitizer with gcc supports no other fence; x86 needs none
        std::atomic_signal_fence(order);
#else
        std::atomic_thread_fence(order);
#endif
    }

    std::atomic<std::uint64_t> turn_{0};  // odd while a cycle counts
    std::atomic<bool> held_{false};
    bool counts_ = false;  // of the cycle thread
};

}  // namespace rtcf::executor
