/// @file
/// Messages of any type for roscpp: bytes that are already serialised. roscpp's traits use `*` for
/// any type.
#pragma once

#include <ros/message_traits.h>
#include <ros/serialization.h>

#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

namespace rtcf::ros1 {

class Departures;

/// A message to send; the bytes must live until publish() returns.
struct RawView {
    const std::uint8_t* bytes;
    std::uint32_t size;
    Departures* departures = nullptr;  ///< tracks the message; null = not tracked
};

/// A received message.
struct RawBytes {
    boost::shared_array<std::uint8_t> bytes;
    std::uint32_t size = 0;
};

/// Allocates memory for messages that are queued or in transfer, outside of locked memory.
/// @param owner kept alive as long as the bytes
/// @throws std::bad_alloc if the limit is reached
boost::shared_array<std::uint8_t> networkBytes(std::size_t bytes,
                                               const std::shared_ptr<void>& owner = nullptr);

/// Tracks the messages of a topic that roscpp has not yet passed to the kernel for all subscribers,
/// because closing a topic drops queued messages. Not thread-safe; the bytes may be freed in any
/// thread.
class Departures {
   public:
    /// The messages until one moment.
    using Until = std::weak_ptr<void>;

    /// @param latch true = roscpp keeps the last message
    explicit Departures(bool latch) : latch_(latch) {}
    /// Allocates bytes for one more message.
    /// @throws std::bad_alloc as networkBytes() does
    boost::shared_array<std::uint8_t> add(std::size_t bytes);
    /// Marks all messages so far.
    Until mark();
    /// True if the marked messages are with the kernel, or lost.
    bool gone(const Until& marked) const;
    /// roscpp no longer keeps the last message.
    void release() { last_.reset(); }

   private:
    bool latch_;
    std::shared_ptr<void> now_ = std::make_shared<char>();
    boost::shared_array<std::uint8_t> last_;  // last message, if roscpp keeps it
};

/// True if the first field of a message definition is `Header header`, whose sequence number roscpp
/// sets.
bool startsWithHeader(const std::string& definition);

}  // namespace rtcf::ros1

namespace ros::message_traits {

template <>
struct IsMessage<rtcf::ros1::RawView> : TrueType {};
template <>
struct IsMessage<rtcf::ros1::RawBytes> : TrueType {};

template <>
struct MD5Sum<rtcf::ros1::RawView> {
    static const char* value() { return "*"; }
    static const char* value(const rtcf::ros1::RawView& /*message*/) { return value(); }
};
template <>
struct DataType<rtcf::ros1::RawView> {
    static const char* value() { return "*"; }
    static const char* value(const rtcf::ros1::RawView& /*message*/) { return value(); }
};

}  // namespace ros::message_traits

namespace ros::serialization {

template <>
struct Serializer<rtcf::ros1::RawView> {
    template <typename Stream>
    static void write(Stream& stream, const rtcf::ros1::RawView& message) {
        if (message.size != 0)
            std::memcpy(stream.advance(message.size), message.bytes, message.size);
    }
    static std::uint32_t serializedLength(const rtcf::ros1::RawView& message) {
        return message.size;
    }
};

template <>
struct Serializer<rtcf::ros1::RawBytes> {
    template <typename Stream>
    static void read(Stream& stream, rtcf::ros1::RawBytes& message) {
        const std::uint32_t size = stream.getLength();
        const std::uint8_t* bytes = stream.advance(size);
        message.bytes = rtcf::ros1::networkBytes(size);
        message.size = size;
        if (size != 0) std::memcpy(message.bytes.get(), bytes, size);
    }
};

/// Like roscpp's function, but with network memory.
template <>
inline SerializedMessage serializeMessage(const rtcf::ros1::RawView& message) {
    const std::uint32_t size = message.size + 4;
    SerializedMessage serialized(message.departures != nullptr ? message.departures->add(size)
                                                               : rtcf::ros1::networkBytes(size),
                                 size);
    OStream stream(serialized.buf.get(), size);
    serialize(stream, message.size);
    serialized.message_start = stream.getData();
    serialize(stream, message);
    return serialized;
}

}  // namespace ros::serialization
