/// @file
/// All ROS messages as port types, by roscpp's traits.
#pragma once

#include <ros/message_operations.h>
#include <ros/message_traits.h>
#include <ros/serialization.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "rtcf/exact_text.hpp"
#include "rtcf/port_type.hpp"

namespace rtcf {

namespace detail {

/// Joins the lines of a printed message, as a port's value is shown on one line.
inline std::string joinLines(const std::string& lines) {
    std::string joined;
    for (const char c : lines) {
        if (c != '\n') {
            joined += c;
        } else if (!joined.empty() && joined.back() != ' ') {
            joined += ' ';
        }
    }
    while (!joined.empty() && joined.back() == ' ') joined.pop_back();
    return joined;
}

/// A stream that limits memory: roscpp resizes a vector to the received element count before it
/// checks the remaining bytes, so twelve bytes could allocate gigabytes.
struct BoundedStream : ros::serialization::IStream {
    using IStream::IStream;
    template <typename T>
    void next(T& value) {
        deserialize(*this, value);
    }
    template <typename T>
    BoundedStream& operator>>(T& value) {
        deserialize(*this, value);
        return *this;
    }
};

/// Checks the element count of a vector before roscpp deserialises it. Found by argument-dependent
/// lookup; roscpp handles all other types, and the elements of vectors.
template <typename T, typename Allocator>
void deserialize(BoundedStream& stream, std::vector<T, Allocator>& values) {
    static const std::uint32_t least = std::max(1U, ros::serialization::serializationLength(T()));
    BoundedStream ahead = stream;
    std::uint32_t count = 0;
    ros::serialization::deserialize(ahead, count);
    if (std::uint64_t{count} * least > ahead.getLength())
        throw std::length_error("fewer bytes than the elements of a vector have");
    ros::serialization::deserialize(stream, values);
}

/// Replaces the stream in a message's serializer, and records the address of each field.
class CopyVisitor {
   public:
    /// @param object the message, of `size` bytes in memory
    CopyVisitor(const void* object, std::size_t size)
        : object_(static_cast<const std::uint8_t*>(object)), size_(size) {}

    template <typename T>
    void next(const T& field) {
        if constexpr (std::is_arithmetic_v<T>) {
            add(reinterpret_cast<const std::uint8_t*>(&field), sizeof field);
        } else if constexpr (std::is_same_v<T, ros::Time> || std::is_same_v<T, ros::Duration>) {
            next(field.sec);
            next(field.nsec);
        } else if constexpr (ros::message_traits::IsMessage<T>::value) {
            ros::serialization::Serializer<T>::template allInOne<CopyVisitor, const T&>(*this,
                                                                                        field);
        } else if constexpr (IsSequence<T>::value) {
            for (const auto& item : field) next(item);
        } else {
            known_ = false;
        }
    }

    ByteCopies copies() && { return known_ ? ByteCopies(std::move(copies_)) : std::nullopt; }

   private:
    void add(const std::uint8_t* field, std::uint32_t bytes) {
        // A custom serializer may write computed values, which are not in the message object.
        known_ = known_ && !std::less<>()(field, object_) &&
                 !std::less<>()(object_ + size_, field + bytes);
        if (!known_) return;
        const auto from = static_cast<std::uint32_t>(field - object_);
        if (!copies_.empty() && copies_.back().from + copies_.back().size == from) {
            copies_.back().size += bytes;
        } else {
            copies_.push_back({from, written_, bytes});
        }
        written_ += bytes;
    }

    const std::uint8_t* object_;
    std::size_t size_;
    std::vector<ByteCopy> copies_;
    std::uint32_t written_ = 0;
    bool known_ = true;
};

}  // namespace detail

template <typename T>
struct PortType<T, std::enable_if_t<ros::message_traits::IsMessage<T>::value>> {
    static constexpr bool kFixedSize = ros::message_traits::IsFixedSize<T>::value;
    static constexpr bool kPlain = true;
    static const char* name() { return ros::message_traits::datatype<T>(); }
    static const char* md5() { return ros::message_traits::md5sum<T>(); }
    static const char* rosType() { return name(); }
    static const char* rosMd5() { return md5(); }
    static const char* rosDefinition() { return ros::message_traits::definition<T>(); }
    static std::uint32_t length(const T& value) {
        return ros::serialization::serializationLength(value);
    }
    static void serialize(const T& value, std::uint8_t* to, std::uint32_t size) {
        ros::serialization::OStream stream(to, size);
        ros::serialization::serialize(stream, value);
    }
    static void deserialize(T& value, const std::uint8_t* from, std::uint32_t size) {
        // roscpp's stream takes a mutable pointer although it only reads.
        detail::BoundedStream stream(const_cast<std::uint8_t*>(from), size);
        ros::serialization::deserialize(stream, value);
        if (stream.getLength() != 0) throw std::length_error("bytes after the end of the message");
    }
    static std::string print(const T& value) {
        std::ostringstream text;
        detail::makeExact(text);
        ros::message_operations::Printer<T>::stream(text, "", value);
        return detail::joinLines(text.str());
    }
    static ByteCopies copies() {
        const auto message = std::make_unique<T>();
        detail::CopyVisitor visitor(message.get(), sizeof(T));
        visitor.next(*message);
        return std::move(visitor).copies();
    }
};

/// Base of a PortType whose ROS message is `Message`. `Conversion` has the static functions
/// `name()`, `toMessage(const T&, Message&)` and `fromMessage(const Message&, T&)`. It may also
/// have `static std::vector<ByteCopy> copies()`, if copying these bytes into a default-constructed
/// message is equivalent to toMessage().
template <typename T, typename Message, typename Conversion>
struct MappedPortType {
    using Wire = PortType<Message>;
    static constexpr bool kFixedSize = Wire::kFixedSize && std::is_trivially_destructible_v<T>;
    static constexpr bool kBuildsMessage = !Wire::kFixedSize;
    static const char* name() { return Conversion::name(); }
    static const char* md5() { return Wire::md5(); }
    static const char* rosType() { return Wire::rosType(); }
    static const char* rosMd5() { return Wire::rosMd5(); }
    static const char* rosDefinition() { return Wire::rosDefinition(); }
    static std::uint32_t length(const T& value) {
        if constexpr (Wire::kFixedSize) {
            return Wire::length(Message());
        } else {
            return Wire::length(message(value));
        }
    }
    static void serialize(const T& value, std::uint8_t* to, std::uint32_t size) {
        Wire::serialize(message(value), to, size);
    }
    static void deserialize(T& value, const std::uint8_t* from, std::uint32_t size) {
        Message wire;
        Wire::deserialize(wire, from, size);
        Conversion::fromMessage(wire, value);
    }
    static std::string print(const T& value) { return Wire::print(message(value)); }
    static std::string sample() { return detail::sampleOf<Message>(); }
    static ByteCopies copies() {
        if constexpr (detail::HasCopies<Conversion>::value) {
            return Conversion::copies();
        } else {
            return std::nullopt;
        }
    }

   private:
    static Message message(const T& value) {
        Message wire;
        Conversion::toMessage(value, wire);
        return wire;
    }
};

}  // namespace rtcf
