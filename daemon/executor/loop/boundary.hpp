/// @file
/// What the graph thread has to be done between two cycles, by whoever runs
/// them. One thing at a time: the graph thread waits until it is done, or takes
/// it back.
#pragma once

#include <sched.h>

#include <atomic>

#include "rtcf/realtime.hpp"

namespace rtcf::executor {

class Cycle;

/// Something to be done at a boundary. Owned by the graph thread.
class BoundaryWork {
   public:
    BoundaryWork() = default;
    BoundaryWork(const BoundaryWork&) = delete;
    BoundaryWork& operator=(const BoundaryWork&) = delete;
    /// Real-time safe. @return false if the next boundary is to go on with it
    virtual bool perform(Cycle& cycle) noexcept = 0;

   protected:
    ~BoundaryWork() = default;
};

/// The place where it waits.
class Boundary {
   public:
    /// @name Graph thread
    /// @{
    void offer(BoundaryWork& work) noexcept { place_.store(&work, std::memory_order_release); }
    bool pending() const noexcept { return place_.load(std::memory_order_acquire) != nullptr; }
    /// Takes back what has not been done. @return false if it has been; waits while it is
    bool withdraw(BoundaryWork& work) noexcept {
        while (true) {
            BoundaryWork* expected = &work;
            if (place_.compare_exchange_strong(expected, nullptr, std::memory_order_acq_rel))
                return true;
            if (expected == nullptr) return false;
            sched_yield();  // done in a moment
        }
    }
    /// @}

    /// @name Whoever runs cycles; real-time safe
    /// @{
    bool waiting() const noexcept RTCF_NONBLOCKING {
        return place_.load(std::memory_order_relaxed) != nullptr;
    }
    void perform(Cycle& cycle) noexcept {
        BoundaryWork* work = place_.load(std::memory_order_acquire);
        if (work == nullptr) return;
        // Claimed before it is done, so that the graph thread cannot take it back meanwhile.
        if (!place_.compare_exchange_strong(work, &claimed_, std::memory_order_acq_rel)) return;
        const bool done = work->perform(cycle);
        place_.store(done ? nullptr : work, std::memory_order_release);
    }
    /// @}

   private:
    class Claimed final : public BoundaryWork {
        bool perform(Cycle& /*cycle*/) noexcept override { return true; }
    };
    std::atomic<BoundaryWork*> place_{nullptr};
    Claimed claimed_;  // stands in place_ while work is done
};

}  // namespace rtcf::executor
