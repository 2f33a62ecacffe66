/// @file
/// An injector brings values into the loop: a thread deserialises a message
/// into the free slot of a triple buffer, the real-time thread takes the newest
/// at the next cycle boundary. Neither ever waits; only the newest value counts, but for
/// queues, which get every one.
/// Under a simulated clock, whose cycles come in bursts, values queue up until
/// it is known which cycle is the first after them.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

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
    /// @param type  of all inputs that read it
    Injector(std::string topic, const TypeInfo& type);

    const std::string& topic() const noexcept { return topic_; }
    const TypeInfo& type() const noexcept { return type_; }

    /// Takes one serialised message. Any thread; not real-time safe.
    /// @return false if the bytes are not a message of this type or too many; nothing has changed
    /// then
    /// @param arrived_ns when it came, CLOCK_MONOTONIC; never before the last one
    bool deliver(const std::uint8_t* bytes, std::uint32_t size,
                 std::int64_t arrived_ns = monotonicNow());

    /// Whether a message of so many bytes may come at all; counts it if not. Any thread.
    bool admits(std::uint32_t size);
    /// A message was lost on its way here. Any thread.
    void refuse() { refused_.fetch_add(1, std::memory_order_relaxed); }

    /// Whether messages wait for deliverUntil(). What still waits when that ends is delivered. Any
    /// thread; not real-time safe.
    void setQueueing(bool queueing);

    /// Delivers the newest message that came until then, if any; the older ones are passed over.
    /// Any thread; not real-time safe.
    /// @param rate of the loop's time in real time; what came earlier is older by so much
    void deliverUntil(std::int64_t arrived_ns, double rate = 0.0);
    /// Where messages go besides, each one and in order. Any thread; not real-time safe.
    void setBacklogs(std::vector<std::shared_ptr<Backlog>> backlogs);
    /// Bytes that a message of a type of variable size may have. Any thread.
    void setLargest(std::uint32_t bytes) noexcept {
        largest_.store(bytes, std::memory_order_relaxed);
    }
    /// Messages refused as they were larger. Any thread.
    std::uint64_t tooLarge() const noexcept { return too_large_.load(std::memory_order_relaxed); }

    /// Messages delivered and refused so far. Any thread.
    std::uint64_t delivered() const noexcept { return delivered_.load(std::memory_order_relaxed); }
    std::uint64_t refused() const noexcept { return refused_.load(std::memory_order_relaxed); }
    /// Messages that no cycle has seen, as a newer one was there; none where a queue gets each one.
    /// Any thread.
    std::uint64_t passedOver() const noexcept {
        return passed_over_.load(std::memory_order_relaxed);
    }

    /// The slot that inputs read. Loop side only.
    const SlotHeader* front() const noexcept { return slots_[front_].get(); }

    /// Values adopted so far. Loop side only.
    std::uint64_t sequence() const noexcept RTCF_NONBLOCKING { return sequence_; }
    /// Makes an earlier value the front one, as the one of that number; `slot` gets the one before.
    /// Loop side only; real-time safe. The inputs are then to be told as after adopt().
    void restore(std::shared_ptr<SlotHeader>& slot, std::uint64_t sequence) noexcept
        RTCF_NONBLOCKING {
        slots_[front_].swap(slot);
        sequence_ = sequence;
    }

    /// Makes the newest delivered value the front, stamped with `clock` less its age then. Loop
    /// side only; real-time safe.
    /// @return true if there was a new one; the inputs are then to be told by InputBase::inject()
    bool adopt(const LoopClock& clock) noexcept RTCF_NONBLOCKING {
        if ((middle_.load(std::memory_order_relaxed) & kFresh) == 0) return false;
        front_ = middle_.exchange(front_, std::memory_order_acq_rel) & ~kFresh;
        SlotHeader& slot = *slots_[front_];
        slot.sequence = ++sequence_;
        slot.time_ns = clock.time_ns - slot.time_ns;
        return true;
    }

   private:
    struct Waiting {
        std::int64_t arrived_ns;
        std::vector<std::uint8_t> bytes;
    };
    // While the clock stands, or a loop cannot keep up with it, the oldest beyond these are passed
    // over.
    static constexpr std::size_t kMaxWaiting = 10000;
    static constexpr std::size_t kMaxWaitingBytes = 1024 * 1024;

    void dropOldest();
    void passOver() noexcept;
    bool store(const std::uint8_t* bytes, std::uint32_t size, std::int64_t age_ns = 0);

    static constexpr std::uint32_t kFresh =
        4;  // set in middle_ by deliver(), beside an index 0 to 2

    std::string topic_;
    const TypeInfo& type_;
    // Until it is adopted, the time of a delivered one is its age.
    std::array<std::shared_ptr<SlotHeader>, 3> slots_;
    std::uint32_t fixed_size_ = 0;  // bytes of each message of a type of fixed size
    std::uint32_t front_ = 0;       // loop side
    std::uint64_t sequence_ = 0;    // loop side
    std::atomic<std::uint32_t> middle_{1};
    std::mutex mutex_;  // of the delivering side: back_, backlogs_ and what waits
    std::uint32_t back_ = 2;
    std::vector<std::shared_ptr<Backlog>> backlogs_;
    bool queueing_ = false;
    std::deque<Waiting> waiting_;
    std::size_t waiting_bytes_ = 0;
    std::atomic<std::uint64_t> delivered_{0};
    std::atomic<std::uint64_t> refused_{0};
    std::atomic<std::uint64_t> too_large_{0};
    std::atomic<std::uint64_t> passed_over_{0};
    std::atomic<std::uint32_t> largest_{UINT32_MAX};
};

}  // namespace rtcf::executor
