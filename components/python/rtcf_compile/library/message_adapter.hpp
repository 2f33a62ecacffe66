/// @file
/// The adapter of a ROS message: the functions of its type and the offsets of its fields.
/// rtcf-compile compiles one for each message.
#pragma once

#include <boost/array.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

#include "tables.hpp"

namespace rtcf::python {

template <Scalar scalar>
struct NumberOf;
#define RTCF_PYTHON_NUMBER_(SCALAR, TYPE) \
    template <>                           \
    struct NumberOf<Scalar::SCALAR> {     \
        using Type = TYPE;                \
    }
RTCF_PYTHON_NUMBER_(Bool, std::uint8_t);  // the type in C++ messages
RTCF_PYTHON_NUMBER_(Int8, std::int8_t);
RTCF_PYTHON_NUMBER_(Int16, std::int16_t);
RTCF_PYTHON_NUMBER_(Int32, std::int32_t);
RTCF_PYTHON_NUMBER_(Int64, std::int64_t);
RTCF_PYTHON_NUMBER_(UInt8, std::uint8_t);
RTCF_PYTHON_NUMBER_(UInt16, std::uint16_t);
RTCF_PYTHON_NUMBER_(UInt32, std::uint32_t);
RTCF_PYTHON_NUMBER_(UInt64, std::uint64_t);
RTCF_PYTHON_NUMBER_(Float, float);
RTCF_PYTHON_NUMBER_(Double, double);
#undef RTCF_PYTHON_NUMBER_

template <typename T>
struct IsSequence : std::false_type {};
template <typename T, typename Allocator>
struct IsSequence<std::vector<T, Allocator>> : std::true_type {
    static_assert(std::is_same_v<std::vector<T, Allocator>, std::vector<T>>,
                  "a sequence with an allocator of its own");
};

/// A field of type T whose elements Python knows as `scalar`.
template <typename T, Scalar scalar>
constexpr MessageField field(std::size_t offset) {
    using Number = typename NumberOf<scalar>::Type;
    const auto place = static_cast<std::int64_t>(offset);
    if constexpr (std::is_same_v<T, ros::Time>) {
        return {Form::Time, Scalar::UInt32, place, 1};
    } else if constexpr (std::is_same_v<T, ros::Duration>) {
        return {Form::Time, Scalar::Int32, place, 1};
    } else if constexpr (std::is_same_v<T, std::string>) {
        return {Form::Text, scalar, place, 1};
    } else if constexpr (std::is_arithmetic_v<T>) {
        static_assert(std::is_same_v<T, Number>, "another number than in Python");
        return {Form::Number, scalar, place, 1};
    } else {
        using Element = typename T::value_type;
        constexpr bool kIsText = std::is_same_v<Element, std::string>;
        static_assert(kIsText || std::is_same_v<Element, Number>, "other numbers than in Python");
        if constexpr (IsSequence<T>::value) {
            return {kIsText ? Form::TextSequence : Form::Sequence, scalar, place, 0};
        } else {
            static_assert(sizeof(T) == T::static_size * sizeof(Element), "no plain array");
            return {kIsText ? Form::TextArray : Form::Array, scalar, place, T::static_size};
        }
    }
}

}  // namespace rtcf::python

// A message with strings has no standard layout, but g++ supports offsetof for it.
#pragma GCC diagnostic ignored "-Winvalid-offsetof"

/// The field of `Message` at PATH, such as `header.stamp`.
#define RTCF_PYTHON_FIELD(PATH, SCALAR)                            \
    ::rtcf::python::field<decltype(std::declval<Message&>().PATH), \
                          ::rtcf::python::Scalar::SCALAR>(offsetof(Message, PATH))
