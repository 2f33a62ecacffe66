/// @file
/// Arrays of any size as types of ports and of state: the same types that C++ components have by
/// Eigen::Matrix (of float and double) and by std::array (of others), from a table instead of a
/// template. Real-time safe where TypeInfo says so.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "tables.hpp"

namespace rtcf::python {

/// True if C++ components have an Eigen::Matrix in its place.
inline bool isMatrix(const TypeTable& type) noexcept {
    return type.scalar == Scalar::Float || type.scalar == Scalar::Double;
}

/// True if C++ components have the elements in another order than the record: column by column.
inline bool isTransposed(const TypeTable& type) noexcept {
    return isMatrix(type) && type.rows > 1 && type.columns > 1;
}

/// Bytes of a value, or of a single number. Real-time safe.
std::size_t sizeOf(const TypeTable& type) noexcept;

/// The type of ports. Not real-time safe. @return lives as long as the library
const TypeInfo& typeInfoOf(const TypeTable& type);

/// A state of the type, without a name and a place. Not real-time safe.
StateDeclaration stateOf(const TypeTable& type);

/// The functions of TypeInfo and StateDeclaration, for an array.
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
