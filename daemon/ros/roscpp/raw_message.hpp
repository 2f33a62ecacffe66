/// @file
/// Messages of any type as roscpp sees them here: bytes that are serialised
/// already. roscpp's traits take a type of `*` for any.
#pragma once

#include <ros/message_traits.h>
#include <ros/serialization.h>

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace rtcf::ros1 {

/// A message to be sent: bytes that live until publish() has returned.
struct RawView {
    const std::uint8_t* bytes;
    std::uint32_t size;
};

/// A message that was received.
struct RawBytes {
    boost::shared_array<std::uint8_t> bytes;
    std::uint32_t size = 0;
};

/// Bytes that wait, or are on their way, outside of the memory that is locked for the loop.
/// @throws std::bad_alloc if there are too many
boost::shared_array<std::uint8_t> networkBytes(std::size_t bytes);

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
    SerializedMessage serialized(rtcf::ros1::networkBytes(size), size);
    OStream stream(serialized.buf.get(), size);
    serialize(stream, message.size);
    serialized.message_start = stream.getData();
    serialize(stream, message);
    return serialized;
}

}  // namespace ros::serialization
