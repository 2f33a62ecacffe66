/// @file
/// The tap of a type whose messages have different sizes. The real-time thread serialises each new
/// value into a byte ring; the reader's thread takes it from there. A value that does not fit is
/// dropped and counted. If the message of a type has to be built (TypeInfo::builds_message), the
/// ring contains the values as they are in memory, and the reader's thread builds the messages.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "exchange/tap.hpp"
#include "rtcf/port_type.hpp"
#include "rtcf/realtime.hpp"
#include "statistics/counter.hpp"

namespace rtcf::executor {

/// Single-producer single-consumer ring of values of one output.
class SerializedTap final : public Tap {
   public:
    /// @param topic    mapped name of the connection
    /// @param type     type of the output; flat if it builds messages
    /// @param source   slot of the output; the tap keeps it alive
    /// @param capacity size of the ring, bytes; enlarged to hold two samples
    /// @param largest  largest message, bytes
    SerializedTap(std::string topic, const TypeInfo& type, std::shared_ptr<const SlotHeader> source,
                  std::size_t capacity, std::size_t largest = SIZE_MAX);

    /// Size of a sample's record in the ring, bytes.
    static std::size_t recordBytes(const TypeInfo& type);
    /// Size of the ring of a tap with this type and capacity, bytes.
    static std::size_t ringBytes(const TypeInfo& type, std::size_t capacity);
    /// Size of the ring, bytes.
    std::size_t ringBytes() const noexcept { return ring_.size(); }
    /// Largest value, bytes.
    std::size_t largest() const noexcept { return largest_; }
    /// Copies the source's value if it was written since the last call. Producer only; real-time
    /// safe.
    /// @param stamp_ns ROS time of the cycle, ns
    void push(std::int64_t stamp_ns) noexcept RTCF_NONBLOCKING;

    /// Lets the next push() take the source's value, if there is one: it was replaced. Producer
    /// only; real-time safe.
    void forget() noexcept RTCF_NONBLOCKING { last_stamp_ = 0; }
    /// Follows a move of the loop's time by `by` ns. Producer only; real-time safe.
    void moveTime(std::int64_t by) noexcept RTCF_NONBLOCKING {
        last_stamp_ = movedStamp(last_stamp_, by);
    }

    bool pop(const Use& use) override;
    std::uint64_t tooLarge() const noexcept override { return too_large_.value(); }
    std::uint64_t dropped() const noexcept override { return dropped_.value() + unbuilt_.value(); }

   private:
    // A record is a length, a stamp and the bytes, each padded to kAlign. The length kSkip means
    // that the rest of the ring is unused.
    static constexpr std::size_t kAlign = 8;
    static constexpr std::size_t kHead = 2 * kAlign;
    static constexpr std::uint32_t kSkip = 0xffffffffU;

    static constexpr std::size_t padded(std::size_t bytes) {
        return (bytes + kAlign - 1) / kAlign * kAlign;
    }
    // Size of a sample in the ring, bytes.
    static std::size_t valueBytes(const TypeInfo& type);
    // Builds the message of a value in the ring. Consumer.
    // @return false if that fails
    bool build(const std::uint8_t* value);
    std::uint32_t lengthAt(std::size_t offset) const noexcept;
    std::int64_t stampAt(std::size_t offset) const noexcept;

    std::int64_t last_stamp_ = 0;
    std::uint32_t passed_over_ = 0;  // values skipped since the last one taken
    std::size_t largest_;
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

}  // namespace rtcf::executor
