/// @file
/// An injector brings values from outside into the loop. A thread deserialises a message into the
/// free slot of a triple buffer; the cycle thread takes the newest one at the next cycle boundary.
/// Neither side waits. Only the newest value counts, except for queues, which get every message.
/// Under a simulated clock, cycles come in bursts, so messages wait until the clock has reached the
/// first cycle after them.
/// A running loop counts a value's age from the cycle that takes it. Values that arrived before the
/// start of a loop are old, and of their true age. Steps have no real time between them: what
/// arrives meanwhile belongs to the next cycle.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "exchange/attention.hpp"
#include "exchange/backlog.hpp"
#include "realtime/cycle_counter.hpp"
#include "rtcf/port.hpp"
#include "rtcf/port_type.hpp"
#include "rtcf/realtime.hpp"

namespace rtcf::executor {

/// Triple buffer of one connection's values from outside.
class Injector {
   public:
    /// @param topic mapped name of the connection
    /// @param type  type of all inputs of the connection
    Injector(std::string topic, const TypeInfo& type);

    const std::string& topic() const noexcept { return topic_; }
    const TypeInfo& type() const noexcept { return type_; }

    /// Delivers one serialised message. Any thread; not real-time safe.
    /// @param arrived_ns arrival, CLOCK_MONOTONIC, ns; never before the last one
    /// @param is_old the sender may have sent it long ago; inputs read it as old, queues drop it
    /// @return false if the bytes are not a message of this type, or too large; nothing has changed
    /// then
    bool deliver(const std::uint8_t* bytes, std::uint32_t size,
                 std::int64_t arrived_ns = monotonicNow(), bool is_old = false);

    /// True if a message of `size` bytes is allowed; else counts it as rejected. Any thread.
    bool admits(std::uint32_t size);
    /// Counts a message that was lost before it reached the injector. Any thread.
    void refuse() { refused_.fetch_add(1, std::memory_order_relaxed); }

    /// Sets whether somebody writes the topic; a delivered message sets it, too. Any thread.
    void setFed(bool fed) noexcept { fed_ = fed; }
    /// See InputPort::connectOutside().
    const Shared<bool>& fed() const noexcept RTCF_NONBLOCKING { return fed_; }

    /// Sets whether messages wait for deliverUntil(). Switching it off delivers the waiting ones.
    /// Any thread; not real-time safe.
    void setQueueing(bool queueing);

    /// Delivers the newest message that arrived until `arrived_ns`, if any; older ones count as
    /// skipped. Queues get all of them. Any thread; not real-time safe.
    /// @param rate loop time per real time; a message's age is its real age times this
    void deliverUntil(std::int64_t arrived_ns, double rate = 0.0);
    /// Sets the word by which a cycle sees that there is a message. Any thread; not real-time safe.
    void setAttention(std::shared_ptr<Attention> attention);
    /// Sets the backlogs of queues, which get each message in order. Any thread; not real-time
    /// safe.
    void setBacklogs(std::vector<std::shared_ptr<Backlog>> backlogs);
    /// Sets the largest message of a type of variable size, bytes. Any thread.
    void setLargest(std::uint32_t bytes) noexcept {
        largest_.store(bytes, std::memory_order_relaxed);
    }
    /// Number of messages rejected because they were larger. Any thread.
    std::uint64_t tooLarge() const noexcept { return too_large_.load(std::memory_order_relaxed); }

    /// Number of messages delivered and rejected so far. Any thread.
    std::uint64_t delivered() const noexcept { return delivered_.load(std::memory_order_relaxed); }
    std::uint64_t refused() const noexcept { return refused_.load(std::memory_order_relaxed); }
    /// Number of messages that no cycle has seen, because a newer one replaced them; always 0 if a
    /// queue gets each message. Any thread.
    std::uint64_t passedOver() const noexcept {
        return passed_over_.load(std::memory_order_relaxed);
    }

    /// The slot that inputs read. Cycle thread.
    const SlotHeader* front() const noexcept { return slots_[front_].get(); }
    /// Arrival of its value, CLOCK_MONOTONIC, ns. Cycle thread.
    std::int64_t arrived() const noexcept RTCF_NONBLOCKING { return arrivals_[front_].time_ns; }
    /// True if its value is not new to inputs. Cycle thread.
    bool isOld() const noexcept RTCF_NONBLOCKING { return arrivals_[front_].is_old; }

    /// Swaps `slot` with the front slot. The caller then connects the inputs to it. Cycle thread;
    /// real-time safe.
    /// @param arrived_ns arrival of its value, CLOCK_MONOTONIC, ns
    void restore(std::shared_ptr<SlotHeader>& slot, std::int64_t arrived_ns) noexcept
        RTCF_NONBLOCKING {
        slots_[front_].swap(slot);
        arrivals_[front_] = {arrived_ns, true};
    }

    /// @name Start of the loop; graph thread, while no cycle runs
    /// @{
    /// Sets the age of the front slot's value, if any, at the loop time `time_ns`. Also at a
    /// boundary; real-time safe.
    void setAge(std::int64_t age_ns, std::int64_t time_ns) noexcept RTCF_NONBLOCKING {
        if (front()->stamp != 0) slots_[front_]->stamp = stampOf(time_ns - age_ns);
    }
    /// Counts messages that arrived before the start, and that queues have dropped.
    void noteDropped(std::uint64_t count) noexcept { dropped_ += count; }
    /// Their number since the last call.
    std::uint64_t takeDropped() noexcept { return std::exchange(dropped_, 0); }
    /// @}

    /// Makes the newest delivered value the front slot; its time is the loop's time minus its age.
    /// Cycle thread; real-time safe.
    /// @return true if there is a new value; the caller then calls InputPort::inject()
    bool adopt(const LoopClock& clock) noexcept RTCF_NONBLOCKING {
        if ((middle_.load(std::memory_order_relaxed) & kFresh) == 0) return false;
        front_ = middle_.exchange(front_, std::memory_order_acq_rel) & ~kFresh;
        SlotHeader& slot = *slots_[front_];
        slot.stamp = stampOf(clock.time_ns - slot.stamp);
        return true;
    }

   private:
    struct Arrival {
        std::int64_t time_ns = 0;  // CLOCK_MONOTONIC
        bool is_old = false;
    };
    struct Waiting {
        Arrival arrival;
        std::vector<std::uint8_t> bytes;
    };
    // Limits of waiting messages, while the clock stands or the loop cannot keep up. Beyond them,
    // the oldest messages are skipped.
    static constexpr std::size_t kMaxWaiting = 10000;
    static constexpr std::size_t kMaxWaitingBytes = 1024 * 1024;

    void dropOldest();
    void passOver() noexcept;
    bool store(const std::uint8_t* bytes, std::uint32_t size, const Arrival& arrival,
               std::int64_t age_ns);

    // Flag in middle_, beside an index from 0 to 2: the slot has not been adopted yet.
    static constexpr std::uint32_t kFresh = 4;

    std::string topic_;
    const TypeInfo& type_;
    // Before adoption, the stamp of a delivered slot is its age.
    std::array<std::shared_ptr<SlotHeader>, 3> slots_;
    std::array<Arrival, 3> arrivals_;  // of the slots' values
    std::uint64_t dropped_ = 0;        // of the graph thread
    std::uint32_t fixed_size_ = 0;     // size of a message of a type of fixed size, bytes
    std::uint32_t front_ = 0;          // of the cycle thread
    std::atomic<std::uint32_t> middle_{1};
    std::mutex mutex_;  // of the delivering threads; protects the members up to waiting_bytes_
    std::uint32_t back_ = 2;
    std::shared_ptr<Attention> attention_;  // null before the first schedule
    std::vector<std::shared_ptr<Backlog>> backlogs_;
    bool queueing_ = false;
    std::deque<Waiting> waiting_;
    std::size_t waiting_bytes_ = 0;
    Shared<bool> fed_ = false;
    std::atomic<std::uint64_t> delivered_{0};
    std::atomic<std::uint64_t> refused_{0};
    std::atomic<std::uint64_t> too_large_{0};
    std::atomic<std::uint64_t> passed_over_{0};
    std::atomic<std::uint32_t> largest_{UINT32_MAX};
};

}  // namespace rtcf::executor
