/// @file
/// User-defined port types: trivially copyable structs, enums, std::array, std::string, and
/// std::vector of trivially copyable types. They stay inside the runner unless they are mapped to a
/// ROS message (MappedPortType in message_type.hpp):
///
///     struct GainsOnRos {
///         static const char* name() { return "Gains"; }
///         static void toMessage(const Gains& value, my_msgs::Gains& message);
///         static void fromMessage(const my_msgs::Gains& message, Gains& value);
///     };
///     template <>
///     struct rtcf::PortType<Gains> : rtcf::MappedPortType<Gains, my_msgs::Gains, GainsOnRos> {};
///
/// If toMessage() only copies bytes, GainsOnRos can declare the copies (ByteCopy). Recordings of
/// incidents then contain these values too; rtcf runs no conversion only for a recording:
///
///         static std::vector<rtcf::ByteCopy> copies() { return {{0, 0, sizeof(Gains)}}; }
///
/// Two components can exchange values of such a type if both were built with the same definition.
/// rtcf compares name, size and alignment, and the fields of structs that name them (see
/// state_type.hpp). A type of an anonymous namespace must name its fields to be exchanged between
/// components of different source files or builds. The type must contain no pointers, as values are
/// copied byte by byte.
#pragma once

#include <cxxabi.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <typeinfo>
#include <utility>
#include <vector>

#include "rtcf/finite.hpp"
#include "rtcf/message_type.hpp"
#include "rtcf/state_type.hpp"

namespace rtcf {

namespace detail {

/// The demangled name of a type; the same in every library.
template <typename T>
const char* cppName() {
    static const std::string name = [] {
        if constexpr (std::is_same_v<T, std::string>) return std::string("std::string");
        int status = 0;
        const std::unique_ptr<char, void (*)(void*)> spelled(
            abi::__cxa_demangle(typeid(T).name(), nullptr, nullptr, &status), &std::free);
        return status == 0 ? std::string(spelled.get()) : std::string(typeid(T).name());
    }();
    return name.c_str();
}

template <typename T>
constexpr bool kIsBytes = std::is_trivially_copyable_v<T> && std::is_default_constructible_v<T> &&
                          !std::is_pointer_v<T> && !std::is_reference_v<T>;

/// True for a struct that names its fields, and for sequences of such structs.
template <typename T, typename = void>
struct HasLayout : NamesFields<T> {};
template <typename T>
struct HasLayout<T, std::void_t<typename T::value_type>> : HasLayout<typename T::value_type> {};

/// A hash of the names, types and offsets of a struct's fields, down to their own fields. Libraries
/// of different builds, and compilers, have the same hash for the same definition.
template <typename T>
std::uint64_t layoutOf();

struct FieldLayouts {
    const void* object;
    std::uint64_t hash;
    template <typename Field>
    void operator()(const char* name, const Field& field) {
        const auto offset =
            reinterpret_cast<const char*>(&field) - static_cast<const char*>(object);
        hash = stateHash(name, hash);
        hash = stateHash(layoutOf<Field>(), hash);
        hash = stateHash(static_cast<std::uint64_t>(offset), hash);
    }
};

template <typename T>
std::uint64_t layoutOf() {
    if constexpr (NamesFields<T>::value) {
        T object{};
        FieldLayouts visitor{&object, stateHash("struct")};
        object.fields(visitor);
        return visitor.hash;
    } else if constexpr (std::is_array_v<T>) {
        return stateHash(std::extent_v<T>, stateHash("array", layoutOf<std::remove_extent_t<T>>()));
    } else if constexpr (IsEigenMatrix<T>::value || IsEigenQuaternion<T>::value ||
                         IsEigenTransform<T>::value ||
                         (std::is_arithmetic_v<T> && !std::is_same_v<T, long double>)) {
        return StateType<T>::identity();
    } else if constexpr (IsSequence<T>::value) {
        return stateHash(sizeof(T), stateHash("array", layoutOf<typename T::value_type>()));
    } else {
        return stateHash(alignof(T), stateHash(sizeof(T), stateHash(ownName<T>())));
    }
}

/// The hash as text; empty if there are no named fields.
template <typename T>
const char* layoutText() {
    if constexpr (!HasLayout<T>::value) {
        return "";
    } else if constexpr (NamesFields<T>::value) {
        static const std::string text = fmt::format("{:016x}", layoutOf<T>());
        return text.c_str();
    } else {
        return layoutText<typename T::value_type>();
    }
}

/// Conversion of values to bytes: for types of fixed size, and for sequences of them.
template <typename T>
struct Bytes {
    static constexpr bool kPossible = kIsBytes<T>;
    static constexpr bool kFixedSize = true;
    static std::uint32_t length(const T&) { return sizeof(T); }
    static void store(const T& value, std::uint8_t* to) { std::memcpy(to, &value, sizeof(T)); }
    static void load(T& value, const std::uint8_t* from, std::uint32_t size) {
        if (size != sizeof(T)) throw std::length_error("not of the type's size");
        std::memcpy(static_cast<void*>(&value), from, sizeof(T));
    }
};

template <typename Sequence, typename Element>
struct SequenceBytes {
    static constexpr bool kPossible = kIsBytes<Element>;
    static constexpr bool kFixedSize = false;
    static std::uint32_t length(const Sequence& value) {
        return static_cast<std::uint32_t>(value.size() * sizeof(Element));
    }
    static void store(const Sequence& value, std::uint8_t* to) {
        // NOLINTNEXTLINE(bugprone-not-null-terminated-result): bytes, not text
        if (!value.empty()) std::memcpy(to, value.data(), value.size() * sizeof(Element));
    }
    static void load(Sequence& value, const std::uint8_t* from, std::uint32_t size) {
        if (size % sizeof(Element) != 0) throw std::length_error("not of the elements' size");
        value.resize(size / sizeof(Element));
        if (size != 0) std::memcpy(static_cast<void*>(value.data()), from, size);
    }
};
template <>
struct Bytes<std::string> : SequenceBytes<std::string, char> {};
template <typename Element, typename Allocator>
struct Bytes<std::vector<Element, Allocator>>
    : SequenceBytes<std::vector<Element, Allocator>, Element> {};
template <typename Allocator>
struct Bytes<std::vector<bool, Allocator>> {
    static constexpr bool kPossible = false;  // its elements are bits
};

/// Prints a value: numbers, strings and sequences as text, other types as hexadecimal bytes.
template <typename T>
void printAny(std::string& text, const T& value) {
    if constexpr (std::is_enum_v<T>) {
        printAny(text, static_cast<std::underlying_type_t<T>>(value));
    } else if constexpr (std::is_same_v<T, bool>) {
        text += value ? "true" : "false";
    } else if constexpr (std::is_integral_v<T>) {
        text += std::to_string(value);
    } else if constexpr (std::is_floating_point_v<T>) {
        std::ostringstream number;
        makeExact(number);
        number << value;
        text += number.str();
    } else if constexpr (std::is_same_v<T, std::string>) {
        text += '"' + value + '"';
    } else if constexpr (IsSequence<T>::value) {
        text += '[';
        bool first = true;
        for (const auto& item : value) {
            if (!std::exchange(first, false)) text += ", ";
            printAny(text, item);
        }
        text += ']';
    } else {
        constexpr std::size_t kShown = 32;
        std::array<std::uint8_t, sizeof(T)> bytes;
        std::memcpy(bytes.data(), &value, sizeof(T));
        text += "0x";
        for (std::size_t i = 0; i < std::min(kShown, bytes.size()); ++i) {
            text += "0123456789abcdef"[bytes[i] >> 4];
            text += "0123456789abcdef"[bytes[i] & 15];
        }
        if (bytes.size() > kShown) text += "...";
    }
}

}  // namespace detail

template <typename T>
struct PortType<T, std::enable_if_t<detail::Bytes<T>::kPossible && !std::is_arithmetic_v<T> &&
                                    !ros::message_traits::IsMessage<T>::value>> {
    using Bytes = detail::Bytes<T>;
    static constexpr bool kFixedSize = Bytes::kFixedSize;
    static const char* name() { return detail::cppName<T>(); }
    static const char* md5() { return detail::layoutText<T>(); }
    /// @name Empty: there is no ROS message
    /// @{
    static const char* rosType() { return ""; }
    static const char* rosMd5() { return ""; }
    static const char* rosDefinition() { return ""; }
    /// @}
    static std::uint32_t length(const T& value) { return Bytes::length(value); }
    static void serialize(const T& value, std::uint8_t* to, std::uint32_t) {
        Bytes::store(value, to);
    }
    static void deserialize(T& value, const std::uint8_t* from, std::uint32_t size) {
        Bytes::load(value, from, size);
    }
    static std::string print(const T& value) {
        std::string text;
        detail::printAny(text, value);
        return text;
    }
    static ByteCopies copies() { return std::vector<ByteCopy>{{0, 0, sizeof(T)}}; }
};

}  // namespace rtcf
