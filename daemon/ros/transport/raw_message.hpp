/// @file
/// Messages of any type as roscpp sees them here: bytes that are serialised
/// already. roscpp's traits take a type of `*` for any.
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

/// A message to be sent: bytes that live until publish() has returned.
struct RawView {
    const std::uint8_t* bytes;
    std::uint32_t size;
    Departures* departures = nullptr;  ///< told of the message; null = nobody waits for it
};

/// A message that was received.
struct RawBytes {
    boost::shared_array<std::uint8_t> bytes;
    std::uint32_t size = 0;
};

/// Bytes that wait, or are on their way, outside of the memory that is locked for the loop.
/// @param owner kept as long as they are
/// @throws std::bad_alloc if there are too many
boost::shared_array<std::uint8_t> networkBytes(std::size_t bytes,
                                               const std::shared_ptr<void>& owner = nullptr);

/// The messages of a topic that roscpp has not handed to the kernel yet, for each of its
/// subscribers: a topic that closes drops what waits in roscpp. Not thread-safe; the bytes may go
/// in any thread.
class Departures {
   public:
    /// Those of one moment.
    using Until = std::weak_ptr<void>;

    /// @param latch roscpp keeps the last message
    explicit Departures(bool latch) : latch_(latch) {}
    /// Bytes for one more message. @throws std::bad_alloc as networkBytes() does
    boost::shared_array<std::uint8_t> add(std::size_t bytes);
    /// All messages so far.
    Until mark();
    /// They are with the kernel, or lost.
    bool gone(const Until& marked) const;
    /// Roscpp does not keep the last message any more.
    void release() { last_.reset(); }

   private:
    bool latch_;
    std::shared_ptr<void> now_ = std::make_shared<char>();
    boost::shared_array<std::uint8_t> last_;  // if roscpp keeps it
};

/// True if a message definition's first field is `Header header`, whose
/// sequence number roscpp counts when it publishes.
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

/// As roscpp's, but for where the bytes are.
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
