/// @file
/// A tap copies an output's values out of the loop: the real-time thread
/// serialises each new value into a byte ring, one other thread takes them
/// out. A value that does not fit is dropped and counted, never waited for.
/// If a type has to build its message (TypeInfo::builds_message), the ring has the values as they
/// lie in memory, and the consumer builds the messages.
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
    /// @param type     of the output; flat if it builds messages
    /// @param source   the output's slot, kept alive by the tap
    /// @param capacity bytes of the ring; at least one value of fixed-size types always fits
    /// @param largest bytes that a value of a type of variable size may have
    Tap(std::string topic, const TypeInfo& type, std::shared_ptr<const SlotHeader> source,
        std::size_t capacity, std::size_t largest = SIZE_MAX);

    const std::string& topic() const noexcept { return topic_; }
    const TypeInfo& type() const noexcept { return type_; }
    const SlotHeader* source() const noexcept { return source_.get(); }

    /// Bytes of the ring that a value of fixed size or a flat one takes.
    static std::size_t recordBytes(const TypeInfo& type);
    /// Bytes that the ring of a tap takes that is made with this type and capacity.
    static std::size_t ringBytes(const TypeInfo& type, std::size_t capacity);
    /// Bytes of the ring.
    std::size_t ringBytes() const noexcept { return ring_.size(); }
    /// Bytes that a value may have.
    std::size_t largest() const noexcept { return largest_; }
    /// Of the values that are written, takes each n-th from now on. Any thread.
    void setDecimation(std::uint32_t every) noexcept {
        decimation_.store(every, std::memory_order_relaxed);
    }

    /// Copies the source's value if it was written since the last call. Producer only; real-time
    /// safe. @param stamp_ns of the cycle, ROS time
    void push(std::int64_t stamp_ns) noexcept RTCF_NONBLOCKING;

    /// The source's sequence at the last push(). Producer only; real-time safe.
    std::uint64_t lastSequence() const noexcept RTCF_NONBLOCKING { return last_sequence_; }

    /// Gives the oldest message to `use(const std::uint8_t* bytes, std::uint32_t size, std::int64_t
    /// stamp_ns)` and removes it; without a call if no message can be made of it. The bytes are
    /// valid during the call. Not by the producer; of two concurrent calls one finds nothing.
    /// @return false if the ring is empty
    template <typename Use>
    bool pop(Use&& use);

    /// Values lost as they were larger than allowed. Any thread.
    std::uint64_t tooLarge() const noexcept { return too_large_.value(); }
    /// Values lost because the ring was full, or as their conversion threw. Any thread.
    std::uint64_t dropped() const noexcept { return dropped_.value() + unbuilt_.value(); }

   private:
    // A record is a length, a stamp and the bytes, each padded to kAlign. kSkip for a length: the
    // rest of the ring is empty.
    static constexpr std::size_t kAlign = 8;
    static constexpr std::size_t kHead = 2 * kAlign;
    static constexpr std::uint32_t kSkip = 0xffffffffU;

    static constexpr std::size_t padded(std::size_t bytes) {
        return (bytes + kAlign - 1) / kAlign * kAlign;
    }
    // Bytes of a value in the ring, of a sample if they differ.
    static std::size_t valueBytes(const TypeInfo& type);
    // Makes the message of a value that lies in the ring. Consumer. @return whether there is one
    bool build(const std::uint8_t* value);
    std::uint32_t lengthAt(std::size_t offset) const noexcept;
    std::int64_t stampAt(std::size_t offset) const noexcept;

    std::string topic_;
    const TypeInfo& type_;
    std::shared_ptr<const SlotHeader> source_;
    std::uint64_t last_sequence_ = 0;
    std::uint32_t passed_over_ = 0;  // values since the last one that was taken
    std::atomic<std::uint32_t> decimation_{1};
    std::size_t largest_;
    std::uint32_t fixed_length_;  // bytes of each value in the ring; 0 = they differ
    std::vector<std::uint8_t> ring_;
    std::size_t mask_ = 0;              // the ring's size minus 1
    std::atomic<std::size_t> head_{0};  // bytes ever written, by the producer
    std::atomic<std::size_t> tail_{0};  // bytes ever read, by the consumer
    std::mutex consumer_;               // held in pop()
    // The consumer's, of a type that builds messages: a value, and its message.
    std::shared_ptr<SlotHeader> value_;
    std::vector<std::uint8_t> message_;
    Counter dropped_;
    Counter unbuilt_;
    Counter too_large_;  // by the thread that makes the messages
};

template <typename Use>
bool Tap::pop(Use&& use) {
    // A topic that is closed and opened again has a new reader before the old one has gone.
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
