/// @file
/// Messages from outside the loop that wait to enter a queue (rtcf::Queue). The arriving thread
/// deserialises them; the cycle thread moves them into the queue, in order, at the next cycle
/// boundary. Neither side waits; lost messages count as the queue's drops.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "rtcf/queue.hpp"

namespace rtcf::executor {

class Backlog {
   public:
    /// @param queue outlives this object
    explicit Backlog(QueueBase& queue)
        : type_(queue.type()), queue_(queue), arrived_(type_.make_slot(nullptr)) {
        for (std::size_t i = 0; i < queue.capacity(); ++i)
            slots_.push_back(type_.make_slot(queue.sample()));
    }

    /// Counts a message that is too old for the queue. Any thread.
    void refuse() noexcept { lost_.fetch_add(1, std::memory_order_relaxed); }

    /// Stores a message; ignores bytes that are not a valid message. One thread at a time; not
    /// real-time safe.
    /// @param age_ns age of the message at the next boundary, ns
    void store(const std::uint8_t* bytes, std::uint32_t size, std::int64_t age_ns) {
        const std::size_t head = head_.load(std::memory_order_relaxed);
        if (head - tail_.load(std::memory_order_acquire) == slots_.size()) {
            lost_.fetch_add(1, std::memory_order_relaxed);
            return;
        }
        // Copying keeps the memory reserved in the slot. The slot's value moves to the queue, which
        // an output may feed later.
        if (!type_.deserialize(*arrived_, bytes, size)) return;
        arrived_->stamp = age_ns;
        try {
            type_.copy(*slots_[head % slots_.size()], *arrived_);
        } catch (...) {  // no memory
            lost_.fetch_add(1, std::memory_order_relaxed);
            return;
        }
        head_.store(head + 1, std::memory_order_release);
    }

    /// Moves all messages into the queue. Cycle thread; real-time safe.
    void enter(std::int64_t now_ns) noexcept {
        std::size_t tail = tail_.load(std::memory_order_relaxed);
        for (const std::size_t head = head_.load(std::memory_order_acquire); tail != head; ++tail) {
            SlotHeader& slot = *slots_[tail % slots_.size()];
            queue_.take(slot, now_ns - slot.stamp);
        }
        tail_.store(tail, std::memory_order_release);
        queue_.noteDropped(takeLost());
    }

    /// Drops the messages of the time before a start, also those in the queue. Graph thread, while
    /// no cycle runs.
    /// @return number of messages
    std::uint64_t dropOld() noexcept {
        const std::size_t head = head_.load(std::memory_order_acquire);
        const std::uint64_t dropped =
            queue_.size() + (head - tail_.load(std::memory_order_relaxed)) + takeLost();
        queue_.clear();
        tail_.store(head, std::memory_order_release);
        queue_.noteDropped(dropped);
        return dropped;
    }

    QueueBase& queue() const noexcept { return queue_; }

   private:
    // Number of messages lost since the last call.
    std::uint64_t takeLost() noexcept {
        const std::uint64_t lost = lost_.load(std::memory_order_relaxed);
        return lost - std::exchange(told_, lost);
    }

    const TypeInfo& type_;
    QueueBase& queue_;
    std::shared_ptr<SlotHeader> arrived_;  // of the delivering thread
    std::vector<std::shared_ptr<SlotHeader>> slots_;
    std::atomic<std::size_t> head_{0};  // of the delivering thread
    std::atomic<std::size_t> tail_{0};  // of the cycle thread
    std::atomic<std::uint64_t> lost_{0};
    std::uint64_t told_ = 0;  // of the cycle thread
};

}  // namespace rtcf::executor
