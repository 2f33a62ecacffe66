/// @file
/// A bounded ring for one producer and one consumer, which counts dropped elements. Wait-free on
/// both sides.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "rtcf/realtime.hpp"

namespace rtcf::executor {

template <typename T, std::size_t Capacity>
class SpscRing {
    static_assert((Capacity & (Capacity - 1)) == 0, "the capacity must be a power of two");

   public:
    /// The element to fill next, or null (counted) if the ring is full. Producer; real-time safe.
    T* claim() noexcept RTCF_NONBLOCKING {
        const std::size_t head = head_.load(std::memory_order_relaxed);
        if (head - tail_.load(std::memory_order_acquire) == Capacity) {
            dropped_.store(dropped_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
            return nullptr;
        }
        return &(*items_)[head % Capacity];
    }
    /// Hands over the claimed element. Producer; real-time safe.
    void commit() noexcept RTCF_NONBLOCKING {
        head_.store(head_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
    }

    /// The oldest element, or null. Consumer.
    const T* front() const noexcept {
        const std::size_t tail = tail_.load(std::memory_order_relaxed);
        return head_.load(std::memory_order_acquire) == tail ? nullptr
                                                             : &(*items_)[tail % Capacity];
    }
    /// Removes the oldest element. Consumer.
    void pop() noexcept {
        tail_.store(tail_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
    }

    /// Elements dropped because the ring was full. Any thread.
    std::uint64_t dropped() const noexcept { return dropped_.load(std::memory_order_relaxed); }

   private:
    std::unique_ptr<std::array<T, Capacity>> items_ = std::make_unique<std::array<T, Capacity>>();
    alignas(64) std::atomic<std::size_t> head_{0};
    std::atomic<std::uint64_t> dropped_{0};
    alignas(64) std::atomic<std::size_t> tail_{0};
};

}  // namespace rtcf::executor
