/// @file
/// A tap copies an output's values out of the loop. The real-time thread serialises each new value
/// into a byte ring; one other thread reads them. A value that does not fit is dropped and counted.
/// If the message of a type has to be built (TypeInfo::builds_message), the ring contains the
/// values as they are in memory, and the consumer builds the messages.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "rtcf/port_type.hpp"
#include "rtcf/realtime.hpp"
#include "statistics/counter.hpp"

namespace rtcf::executor {

/// Single-producer single-consumer ring of serialised values of one output.
class Tap {
   public:
    /// @param topic    mapped name of the connection
    /// @param type     type of the output; flat if it builds messages
    /// @param source   slot of the output; the tap keeps it alive
    /// @param capacity size of the ring, bytes; enlarged to hold a value of a fixed-size type
    /// @param largest  largest value of a type of variable size, bytes
    Tap(std::string topic, const TypeInfo& type, std::shared_ptr<const SlotHeader> source,
        std::size_t capacity, std::size_t largest = SIZE_MAX);

    const std::string& topic() const noexcept { return topic_; }
    const TypeInfo& type() const noexcept { return type_; }
    const SlotHeader* source() const noexcept { return source_.get(); }

    /// Size of a record in the ring, for a value of fixed size or a flat one, bytes.
    static std::size_t recordBytes(const TypeInfo& type);
    /// Size of the ring of a tap with this type and capacity, bytes.
    static std::size_t ringBytes(const TypeInfo& type, std::size_t capacity);
    /// Size of the ring, bytes.
    std::size_t ringBytes() const noexcept { return ring_.size(); }
    /// Largest value, bytes.
    std::size_t largest() const noexcept { return largest_; }
    /// Takes every n-th written value from now on. Any thread.
    void setDecimation(std::uint32_t every) noexcept {
        decimation_.store(every, std::memory_order_relaxed);
    }

    /// Copies the source's value if it was written since the last call. Producer only; real-time
    /// safe.
    /// @param stamp_ns ROS time of the cycle, ns
    void push(std::int64_t stamp_ns) noexcept RTCF_NONBLOCKING;

    /// The source's stamp at the last push(). Producer only; real-time safe.
    std::int64_t lastStamp() const noexcept RTCF_NONBLOCKING { return last_stamp_; }
    /// Lets the next push() take the source's value, if there is one: it was replaced. Producer
    /// only; real-time safe.
    void forget() noexcept RTCF_NONBLOCKING { last_stamp_ = 0; }
    /// Follows a move of the loop's time by `by` ns. Producer only; real-time safe.
    void moveTime(std::int64_t by) noexcept RTCF_NONBLOCKING {
        last_stamp_ = movedStamp(last_stamp_, by);
    }

    /// Passes the oldest message to `use(const std::uint8_t* bytes, std::uint32_t size,
    /// std::int64_t stamp_ns)` and removes it. If no message can be built, removes the value
    /// without a call. The bytes are valid during the call. Not for the producer; of two concurrent
    /// calls, one finds the ring empty.
    /// @return false if the ring is empty
    template <typename Use>
    bool pop(Use&& use);

    /// Number of values lost because they were too large. Any thread.
    std::uint64_t tooLarge() const noexcept { return too_large_.value(); }
    /// Number of values lost because the ring was full or their conversion threw. Any thread.
    std::uint64_t dropped() const noexcept { return dropped_.value() + unbuilt_.value(); }

   private:
    // A record is a length, a stamp and the bytes, each padded to kAlign. The length kSkip means
    // that the rest of the ring is unused.
    static constexpr std::size_t kAlign = 8;
    static constexpr std::size_t kHead = 2 * kAlign;
    static constexpr std::uint32_t kSkip = 0xffffffffU;

    static constexpr std::size_t padded(std::size_t bytes) {
        return (bytes + kAlign - 1) / kAlign * kAlign;
    }
    // Size of a value in the ring, bytes; for types of variable size, that of a sample.
    static std::size_t valueBytes(const TypeInfo& type);
    // Builds the message of a value in the ring. Consumer.
    // @return false if that fails
    bool build(const std::uint8_t* value);
    std::uint32_t lengthAt(std::size_t offset) const noexcept;
    std::int64_t stampAt(std::size_t offset) const noexcept;

    std::string topic_;
    const TypeInfo& type_;
    std::shared_ptr<const SlotHeader> source_;
    std::int64_t last_stamp_ = 0;
    std::uint32_t passed_over_ = 0;  // values skipped since the last one taken
    std::atomic<std::uint32_t> decimation_{1};
    std::size_t largest_;
    std::uint32_t fixed_length_;  // size of each value in the ring, bytes; 0 = variable
    std::vector<std::uint8_t> ring_;
    std::size_t mask_ = 0;              // the ring's size minus 1
    std::atomic<std::size_t> head_{0};  // bytes ever written, by the producer
    std::atomic<std::size_t> tail_{0};  // bytes ever read, by the consumer
    std::mutex consumer_;               // held in pop()
    // Of the consumer, for types that build messages: a value, and its message.
    std::shared_ptr<SlotHeader> value_;
    std::vector<std::uint8_t> message_;
    Counter dropped_;
    Counter unbuilt_;
    Counter too_large_;  // written by the thread that serialises
};

template <typename Use>
bool Tap::pop(Use&& use) {
    // If a topic is closed and opened again, a new reader can start before the old one has ended.
    const std::unique_lock<std::mutex> reading(consumer_, std::try_to_lock);
    if (!reading.owns_lock()) return false;
    std::size_t tail = tail_.load(std::memory_order_relaxed);
    const std::size_t head = head_.load(std::memory_order_acquire);
    if (tail == head) return false;
    std::size_t offset = tail & mask_;
    std::uint32_t length = lengthAt(offset);
    if (length == kSkip) {
        tail += mask_ + 1 - offset;
        offset = 0;
        length = lengthAt(0);
    }
    const std::uint8_t* const bytes = ring_.data() + offset + kHead;
    if (!type_.builds_message) {
        use(bytes, length, stampAt(offset));
    } else if (build(bytes)) {
        use(static_cast<const std::uint8_t*>(message_.data()),
            static_cast<std::uint32_t>(message_.size()), stampAt(offset));
    }
    tail_.store(tail + kHead + padded(length), std::memory_order_release);
    return true;
}

}  // namespace rtcf::executor
