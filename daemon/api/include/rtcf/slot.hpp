/// @file
/// The memory of a port's value. The output's component writes it in the real-time thread; inputs
/// read it by pointer, without a copy. The graph keeps a slot alive as long as an input refers to
/// it.
#pragma once

#include <atomic>
#include <cstdint>

namespace rtcf {

/// Stamp of a value. Plain data: while the loop runs, only the real-time thread uses it.
struct SlotHeader {
    /// Loop time of the last write, ns; 0 = never written; after a move of the loop's time also
    /// below 0, see timeOf(). As loop time rises strictly, a reader sees by the stamp alone whether
    /// the value was written since its last read. Several writes in one cycle are one for a reader.
    std::int64_t stamp = 0;
};

/// The stamp of a loop time, ns. Stamps of the times up to 0 are 1 lower, as 0 is none. Real-time
/// safe.
constexpr std::int64_t stampOf(std::int64_t time) noexcept { return time > 0 ? time : time - 1; }

/// The loop time of a stamp, ns. Real-time safe.
constexpr std::int64_t timeOf(std::int64_t stamp) noexcept { return stamp > 0 ? stamp : stamp + 1; }

/// A stamp after the loop's time was moved by `by` ns: a reader sees the same values as new, and of
/// the same age. Real-time safe.
constexpr std::int64_t movedStamp(std::int64_t stamp, std::int64_t by) noexcept {
    return stamp == 0 ? 0 : stampOf(timeOf(stamp) + by);
}

/// A value with its header.
template <typename T>
struct Slot final : SlotHeader {
    T value{};
};

/// A number that one thread writes and others read, without torn values. As fast as a plain number.
/// Real-time safe.
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

/// The clock of the components. The executor writes it at the beginning of each cycle; hooks
/// outside the real-time thread may read it.
struct LoopClock {
    Shared<std::uint64_t> iteration = 0;  ///< cycles since the loop started, from 0
    Shared<std::int64_t> time_ns = 0;     ///< monotonic loop time, ns; simulated under sim time
    Shared<std::int64_t> stamp_ns = 0;    ///< ROS time for message headers, ns since 1970
    Shared<std::int64_t> period_ns = 1'000'000;   ///< nominal period of the loop, ns
    Shared<std::int64_t> elapsed_ns = 1'000'000;  ///< whole periods since the last cycle, ns
};

}  // namespace rtcf
