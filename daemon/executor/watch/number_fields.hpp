/// @file
/// Positions of the numbers in a value copied out of the loop: outputs as serialised ROS messages,
/// states as in memory. For code that compares values without knowing their types.
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

/// Size of a number, bytes.
std::size_t sizeOf(NumberKind kind) noexcept;

/// Consecutive numbers of one kind.
struct NumberField {
    NumberKind kind;
    std::size_t offset;  ///< bytes
    std::size_t count;
};

/// The numbers of a serialised ROS message, in order; a time counts as two.
/// @param definition text of the message definition with those of nested messages, as from genmsg
/// @param sample     a message; all others must have strings and lists of the same lengths
/// @throws std::invalid_argument if the message does not match the definition
std::vector<NumberField> numbersOfMessage(const std::string& definition, const std::string& sample);

/// The numbers of a state, in order; empty for a struct, whose fields are not known here.
/// @param type e.g. "double", "float[3x1]", "quaternion"
/// @param size size of the state, bytes
std::vector<NumberField> numbersOfState(const std::string& type, std::size_t size);

}  // namespace rtcf::executor
