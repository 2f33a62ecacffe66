/// @file
/// The place where a port's value lives. The output's component writes it in
/// the real-time thread; inputs read it there by pointer, without a copy. The
/// graph keeps a slot alive as long as any input refers to it.
#pragma once

#include <atomic>
#include <cstdint>

namespace rtcf {

/// When a value was written. Plain data: only the real-time thread touches it
/// while the loop runs.
struct SlotHeader {
    std::uint64_t sequence = 0;  ///< writes so far; 0 = never written
    std::int64_t time_ns = 0;    ///< the loop's time at the last write, ns
};

/// A value with its bookkeeping.
template <typename T>
struct Slot final : SlotHeader {
    T value{};
};

/// A number that one thread writes while others look at it, each value whole.
/// Costs what a plain number costs.
template <typename T>
class Shared {
   public:
    Shared(T value) noexcept : value_(value) {}  // NOLINT(google-explicit-constructor)
    Shared& operator=(T value) noexcept {
        value_.store(value, std::memory_order_relaxed);
        return *this;
    }
    operator T() const noexcept {  // NOLINT(google-explicit-constructor)
        return value_.load(std::memory_order_relaxed);
    }

   private:
    std::atomic<T> value_;
};

/// The loop's time base as components see it. Written by the executor at the
/// beginning of each cycle; hooks outside the real-time thread read it too.
struct LoopClock {
    Shared<std::uint64_t> iteration = 0;  ///< cycles since the loop started, from 0
    Shared<std::int64_t> time_ns = 0;     ///< monotonic loop time, ns; simulated under sim time
    Shared<std::int64_t> stamp_ns = 0;    ///< ROS time for message headers, ns since 1970
    Shared<std::int64_t> period_ns = 1'000'000;   ///< nominal period of the loop, ns
    Shared<std::int64_t> elapsed_ns = 1'000'000;  ///< whole periods since the last cycle, ns
};

}  // namespace rtcf
