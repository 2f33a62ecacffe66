/// @file
/// The type of a port: of a value, or of a ROS message.
#pragma once

#include <cstddef>
#include <map>
#include <memory>

#include "array_type.hpp"

namespace rtcf::python {

/// The type that a table describes; one of the two tables is null. Not real-time safe.
inline const TypeInfo& typeOf(const TypeTable* type, const MessageTable* message) {
    return message != nullptr ? message->type() : typeInfoOf(*type);
}

/// Offset of a value in its slot, in bytes.
inline std::size_t valueOffset(const TypeInfo& type) noexcept {
    return (sizeof(SlotHeader) + type.alignment - 1) / type.alignment * type.alignment;
}

/// The slot of inputs that are not connected yet; all inputs of a type share it. Not real-time
/// safe. @return lives as long as the library
inline const SlotHeader& emptySlot(const TypeInfo& type) {
    static std::map<const TypeInfo*, std::shared_ptr<SlotHeader>> known;
    std::shared_ptr<SlotHeader>& slot = known[&type];
    if (slot == nullptr) slot = type.make_slot(nullptr);
    return *slot;
}

}  // namespace rtcf::python
