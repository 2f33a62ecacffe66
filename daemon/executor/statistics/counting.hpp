/// @file
/// Whether the cycle that runs is counted, so that figures can be begun anew
/// at one instant. Between two counted cycles all figures are of the same
/// cycles: whoever copies them sees whether it stayed so (a sequence lock).
/// Loops that are late leave no time between cycles: meanwhile cycles are not
/// counted at all, and the loop waits for nobody.
#pragma once

#include <atomic>
#include <cstdint>

#include "rtcf/realtime.hpp"

namespace rtcf::executor {

class Counting {
   public:
    /// A cycle, from before it counts anything until after its overrun is. By whoever runs cycles;
    /// real-time safe.
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

    /// In a turn, by who has it: what happens now counts. Real-time safe.
    bool counts() const noexcept RTCF_NONBLOCKING { return counts_; }

    /// @name One other thread
    /// @{
    /// Cycles that begin from here on are not counted, until release().
    void hold() noexcept { held_.store(true, std::memory_order_relaxed); }
    void release() noexcept { held_.store(false, std::memory_order_relaxed); }
    /// Calls `copy`. @return whether what it has read is of the same cycles; false while one is
    /// being counted
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
        std::atomic_signal_fence(order);  // gcc's knows no others; x86 needs none
#else
        std::atomic_thread_fence(order);
#endif
    }

    std::atomic<std::uint64_t> turn_{0};  // odd while a cycle counts
    std::atomic<bool> held_{false};
    bool counts_ = false;  // of whoever runs cycles
};

}  // namespace rtcf::executor
