/// @file
/// Where the numbers of a value lie that is copied out of the loop: of an output in the ROS message
/// that it travels as, of a state in memory. For whoever compares values without their types.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace rtcf::executor {

enum class NumberKind : std::uint8_t {
    Bool,
    Int8,
    UInt8,
    Int16,
    UInt16,
    Int32,
    UInt32,
    Int64,
    UInt64,
    Float32,
    Float64,
};

/// Bytes of one.
std::size_t sizeOf(NumberKind kind) noexcept;

/// Some numbers, one after the other.
struct NumberField {
    NumberKind kind;
    std::size_t offset;  ///< bytes
    std::size_t count;
};

/// The numbers of a serialised ROS message, in order; a time is two.
/// @param definition its text with those of the messages in it, as genmsg writes it
/// @param sample     one such message: strings and lists are as long in each as in this one
/// @throws std::invalid_argument if one is not that of the other
std::vector<NumberField> numbersOfMessage(const std::string& definition, const std::string& sample);

/// The numbers of a state, in order; none of a structure, whose fields nobody has told.
/// @param type e.g. "double", "float[3x1]", "quaternion"
/// @param size bytes of it
std::vector<NumberField> numbersOfState(const std::string& type, std::size_t size);

}  // namespace rtcf::executor
