/// @file
/// Hand-over of work from the graph thread to a cycle boundary. The cycle thread (see cycle.hpp)
/// performs it between two cycles. One item at a time: the graph thread waits until it is done, or
/// withdraws it.
#pragma once

#include <sched.h>

#include <atomic>

#include "exchange/attention.hpp"
#include "rtcf/realtime.hpp"

namespace rtcf::executor {

class Cycle;

/// Work for a cycle boundary. Owned by the graph thread.
class BoundaryWork {
   public:
    BoundaryWork() = default;
    BoundaryWork(const BoundaryWork&) = delete;
    BoundaryWork& operator=(const BoundaryWork&) = delete;
    /// Real-time safe.
    /// @return false if the work continues at the next boundary
    virtual bool perform(Cycle& cycle) noexcept = 0;

   protected:
    ~BoundaryWork() = default;
};

/// The place where the work waits.
class Boundary {
   public:
    /// @param attention of the cycle thread; outlives this object
    explicit Boundary(Attention& attention) : attention_(attention) {}

    /// @name Graph thread
    /// @{
    void offer(BoundaryWork& work) noexcept {
        // In this order: a cycle that looks here for another reason may perform the work at once.
        attention_.request(Attention::kBoundary);
        place_.store(&work, std::memory_order_release);
    }
    bool pending() const noexcept { return place_.load(std::memory_order_acquire) != nullptr; }
    /// Withdraws the work. Waits while it is being performed.
    /// @return false if it has been performed
    bool withdraw(BoundaryWork& work) noexcept {
        while (true) {
            BoundaryWork* expected = &work;
            if (place_.compare_exchange_strong(expected, nullptr, std::memory_order_acq_rel)) {
                attention_.take(Attention::kBoundary);
                return true;
            }
            if (expected == nullptr) return false;
            sched_yield();  // the work is being performed, which takes a moment
        }
    }
    /// @}

    /// @name Cycle thread; real-time safe
    /// @{
    bool waiting() const noexcept RTCF_NONBLOCKING {
        return place_.load(std::memory_order_relaxed) != nullptr;
    }
    void perform(Cycle& cycle) noexcept {
        BoundaryWork* work = place_.load(std::memory_order_acquire);
        if (work == nullptr) return;
        // Claims the work, so that the graph thread cannot withdraw it meanwhile.
        if (!place_.compare_exchange_strong(work, &claimed_, std::memory_order_acq_rel)) return;
        const bool done = work->perform(cycle);
        if (done) attention_.take(Attention::kBoundary);
        place_.store(done ? nullptr : work, std::memory_order_release);
    }
    /// @}

   private:
    class Claimed final : public BoundaryWork {
        bool perform(Cycle& /*cycle*/) noexcept override { return true; }
    };
    Attention& attention_;
    std::atomic<BoundaryWork*> place_{nullptr};
    Claimed claimed_;  // in place_ while the work is being performed
};

}  // namespace rtcf::executor
