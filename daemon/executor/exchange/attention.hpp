/// @file
/// The word that tells a cycle whether it has any work besides its components. A cycle looks at it
/// once, so work that comes rarely, such as a message or a change of the graph, costs other cycles
/// nothing.
#pragma once

#include <atomic>

#include "rtcf/realtime.hpp"

namespace rtcf::executor {

class Attention {
   public:
    /// Kinds of work.
    enum Work : unsigned {
        kExchange = 1,   ///< latches, queues or serialized taps
        kSelective = 2,  ///< steps that are not plain
        kWarmUp = 4,     ///< device statistics do not count yet
        kWaiting = 8,    ///< inputs wait for their new writers
        kBoundary = 16,  ///< Boundary::waiting()
        kArrived = 32,   ///< values from outside
    };

    /// Requests work of the next cycle: kBoundary or kArrived. Any thread; real-time safe.
    void request(Work work) noexcept RTCF_NONBLOCKING {
        work_.fetch_or(work, std::memory_order_release);
    }
    /// Ends a request, before its work is done, so that a new request stays. Real-time safe.
    void take(Work work) noexcept RTCF_NONBLOCKING {
        work_.fetch_and(~static_cast<unsigned>(work), std::memory_order_acq_rel);
    }

    /// @name Cycle thread; real-time safe
    /// @{
    /// All work of the next cycle; 0 = the cycle is plain.
    unsigned work() const noexcept RTCF_NONBLOCKING {
        return work_.load(std::memory_order_relaxed);
    }
    /// Sets the work of each cycle: all kinds but kBoundary and kArrived.
    void setLasting(unsigned work) noexcept RTCF_NONBLOCKING {
        constexpr unsigned kLasting = kExchange | kSelective | kWarmUp | kWaiting;
        const unsigned changed = (work_.load(std::memory_order_relaxed) & kLasting) ^ work;
        if (changed != 0) work_.fetch_xor(changed, std::memory_order_relaxed);
    }
    /// @}

   private:
    std::atomic<unsigned> work_{0};
};

}  // namespace rtcf::executor
