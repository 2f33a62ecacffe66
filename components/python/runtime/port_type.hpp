/// @file
/// The type of a port: a value's, or a message's by its adapter.
#pragma once

#include <cstddef>
#include <map>
#include <memory>

#include "array_type.hpp"

namespace rtcf::python {

/// The type that one of the two tables describes; the other is null. Not real-time safe.
inline const TypeInfo& typeOf(const TypeTable* type, const MessageTable* message) {
    return message != nullptr ? message->type() : typeInfoOf(*type);
}

/// Where a value begins, in bytes after the beginning of its slot.
inline std::size_t valueOffset(const TypeInfo& type) noexcept {
    return (sizeof(SlotHeader) + type.alignment - 1) / type.alignment * type.alignment;
}

/// The slot that inputs of a type have before they are connected. Not real-time safe. @return lives
/// as long as the library
inline const SlotHeader& emptySlot(const TypeInfo& type) {
    static std::map<const TypeInfo*, std::shared_ptr<SlotHeader>> known;
    std::shared_ptr<SlotHeader>& slot = known[&type];
    if (slot == nullptr) slot = type.make_slot(nullptr);
    return *slot;
}

}  // namespace rtcf::python
