/// @file
/// Arrays of any size as types of ports and of state. A table describes each type, which is
/// identical to a type of C++ components: Eigen::Matrix for float and double, std::array for other
/// elements. An array of three dimensions is only a state, identical to a std::array of arrays of
/// arrays. The functions are real-time safe if TypeInfo requires it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "tables.hpp"

namespace rtcf::python {

/// @return whether the type is an Eigen::Matrix for C++ components
inline bool isMatrix(const TypeTable& type) noexcept {
    return type.depth == 0 && (type.scalar == Scalar::Float || type.scalar == Scalar::Double);
}

/// @return whether a port stores the elements column by column; the record stores them row by row
inline bool isTransposed(const TypeTable& type) noexcept {
    return isMatrix(type) && type.rows > 1 && type.columns > 1;
}

/// Size of a value in bytes. Real-time safe.
std::size_t sizeOf(const TypeTable& type) noexcept;

/// The type of ports that carry it. Not real-time safe. @return lives as long as the library
const TypeInfo& typeInfoOf(const TypeTable& type);

/// Declaration of a state of the type, without name and address. Not real-time safe.
StateDeclaration stateOf(const TypeTable& type);

/// Functions of TypeInfo and StateDeclaration for arrays.
/// @{
extern "C" {
std::shared_ptr<SlotHeader> rtcf_python_make_slot(const TypeTable* type, const SlotHeader* sample);
void rtcf_python_copy(const TypeTable* type, SlotHeader* to, const SlotHeader* from);
void rtcf_python_exchange(const TypeTable* type, SlotHeader* a, SlotHeader* b);
std::uint32_t rtcf_python_length(const TypeTable* type, const SlotHeader* slot);
void rtcf_python_serialize(const TypeTable* type, const SlotHeader* slot, std::uint8_t* to,
                           std::uint32_t size);
bool rtcf_python_deserialize(const TypeTable* type, SlotHeader* slot, const std::uint8_t* from,
                             std::uint32_t size);
std::string rtcf_python_print(const TypeTable* type, const SlotHeader* slot);
bool rtcf_python_finite(const TypeTable* type, const SlotHeader* slot);
std::string rtcf_python_sample(const TypeTable* type);
ByteCopies rtcf_python_copies(const TypeTable* type);
std::string rtcf_python_print_state(const TypeTable* type, const void* value);
}
/// @}

}  // namespace rtcf::python
