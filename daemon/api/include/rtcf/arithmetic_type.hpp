/// @file
/// bool, integers and floating-point numbers as port types. On ROS, each is the std_msgs message of
/// the same width, e.g. std_msgs/Float64 for double.
#pragma once

#include <std_msgs/Bool.h>
#include <std_msgs/Float32.h>
#include <std_msgs/Float64.h>
#include <std_msgs/Int16.h>
#include <std_msgs/Int32.h>
#include <std_msgs/Int64.h>
#include <std_msgs/Int8.h>
#include <std_msgs/UInt16.h>
#include <std_msgs/UInt32.h>
#include <std_msgs/UInt64.h>
#include <std_msgs/UInt8.h>

#include "rtcf/message_type.hpp"

namespace rtcf {

namespace detail {

template <typename T>
struct ArithmeticName;

template <typename T, typename Message>
struct ArithmeticConversion {
    static const char* name() { return ArithmeticName<T>::value; }
    static void toMessage(const T& value, Message& message) { message.data = value; }
    static void fromMessage(const Message& message, T& value) {
        value = static_cast<T>(message.data);
    }
    static std::vector<ByteCopy> copies() { return {{0, 0, sizeof(T)}}; }
};

}  // namespace detail

/// Declares an arithmetic type as a port type. Undefined at the end of this file.
#define RTCF_ARITHMETIC_TYPE(TYPE, NAME, MESSAGE)                                      \
    namespace detail {                                                                 \
    template <>                                                                        \
    struct ArithmeticName<TYPE> {                                                      \
        static constexpr const char* value = NAME;                                     \
    };                                                                                 \
    }                                                                                  \
    template <>                                                                        \
    struct PortType<TYPE>                                                              \
        : MappedPortType<TYPE, MESSAGE, detail::ArithmeticConversion<TYPE, MESSAGE>> { \
        /* a byte of a message may be neither true nor false */                        \
        static constexpr bool kPlain = !std::is_same_v<TYPE, bool>;                    \
    }

RTCF_ARITHMETIC_TYPE(bool, "bool", std_msgs::Bool);
RTCF_ARITHMETIC_TYPE(std::int8_t, "int8", std_msgs::Int8);
RTCF_ARITHMETIC_TYPE(std::int16_t, "int16", std_msgs::Int16);
RTCF_ARITHMETIC_TYPE(std::int32_t, "int32", std_msgs::Int32);
RTCF_ARITHMETIC_TYPE(std::int64_t, "int64", std_msgs::Int64);
RTCF_ARITHMETIC_TYPE(std::uint8_t, "uint8", std_msgs::UInt8);
RTCF_ARITHMETIC_TYPE(std::uint16_t, "uint16", std_msgs::UInt16);
RTCF_ARITHMETIC_TYPE(std::uint32_t, "uint32", std_msgs::UInt32);
RTCF_ARITHMETIC_TYPE(std::uint64_t, "uint64", std_msgs::UInt64);
RTCF_ARITHMETIC_TYPE(float, "float", std_msgs::Float32);
RTCF_ARITHMETIC_TYPE(double, "double", std_msgs::Float64);

#undef RTCF_ARITHMETIC_TYPE

}  // namespace rtcf
