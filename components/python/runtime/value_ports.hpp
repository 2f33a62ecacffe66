/// @file
/// Ports of numbers and arrays. In each cycle, values are copied between slots and the component's
/// record.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "port_type.hpp"
#include "value_copy.hpp"

namespace rtcf::python {

/// Address of a field in the record; null for an offset of -1.
template <typename T>
T* placeIn(std::byte* record, std::int64_t offset) noexcept {
    return offset < 0 ? nullptr : reinterpret_cast<T*>(record + offset);
}

// Machine code accesses values and stamps at these offsets: port_access.py.
static_assert(AbiProbe::portPlaces() == PortPlaces{0, 8, 0, 8});
static_assert(offsetof(SlotHeader, stamp) == 0 && sizeof(SlotHeader) == 8);
static_assert(sizeof(Shared<std::int64_t>) == 8);
/// Offset of a value in its slot; a matrix whose size is a multiple of 16 bytes is aligned to them.
inline std::size_t slotValue(const TypeTable& table) {
    return isMatrix(table) && sizeOf(table) % 16 == 0 ? 16 : 8;
}

/// Not real-time safe. @throws std::logic_error for a type with another offset of values in a slot
inline const TypeInfo& valueTypeOf(const TypeTable& table) {
    const TypeInfo& type = typeInfoOf(table);
    if (valueOffset(type) != slotValue(table))
        throw std::logic_error("unexpected layout of a slot");
    return type;
}

/// Input that provides the newest value. Machine code reads it.
class ValueInput final : public InputBase {
   public:
    ValueInput(Component* owner, const InputTable& table)
        : InputBase(owner, table.name, valueTypeOf(*table.type),
                    emptySlot(valueTypeOf(*table.type)), {table.unit, table.doc}),
          owner_(owner) {}

    /// Real-time safe.
    std::int64_t age() const noexcept { return InputBase::age(owner_); }
    bool connected() const noexcept { return InputBase::connected(owner_); }

   private:
    const Component* owner_;
};

/// Output of values. Machine code writes it.
class ValueOutput final : public OutputBase {
   public:
    ValueOutput(Component* owner, const OutputTable& table, std::byte* record)
        : ValueOutput(owner, table, record, Finite()) {}

    /// Discards the write of a hook. Real-time safe.
    void forget() noexcept { *written_ = false; }

   private:
    ValueOutput(Component* owner, const OutputTable& table, std::byte* record, const Finite& finite)
        : OutputBase(owner, table.name, {table.unit, table.doc}, valueTypeOf(*table.type),
                     table.finite != 0 ? &finite : nullptr),
          written_(placeIn<bool>(record, table.written)) {}

    bool* written_;
};

/// Input that keeps each message, in a ring in the record, from which hooks take messages.
class QueuePort final : public QueueBase {
   public:
    QueuePort(Component* owner, const InputTable& table, std::byte* record)
        : QueuePort(owner, table, record, slotsOf(table)) {}

    /// Moves new messages to the ring; drops and counts messages if it is full. Real-time safe.
    void read() noexcept {
        const std::int64_t now_ns = owner_->time();
        for (const SlotHeader* slot = oldest(); slot != nullptr; slot = oldest()) {
            if (*count_ == capacity_) {
                ++lost_;
            } else {
                std::int64_t place = *oldest_ + (*count_)++;
                if (place >= capacity_) place -= capacity_;
                copy_.toRecord(ring_ + static_cast<std::size_t>(place) * copy_.size(),
                               reinterpret_cast<const std::byte*>(slot) + offset_);
                times_[place] = now_ns - age();
            }
            pop();
        }
        *dropped_ = static_cast<std::int64_t>(dropped() + lost_);
        *connected_ = connected();
    }

   private:
    using Slots = std::vector<std::shared_ptr<SlotHeader>>;

    QueuePort(Component* owner, const InputTable& table, std::byte* record,
              std::unique_ptr<Slots> slots)
        : QueueBase(owner, table.name, typeInfoOf(*table.type), {slots->size(), &at, slots.get()},
                    {table.unit, table.doc}),
          owner_(owner),
          slots_(std::move(slots)),
          copy_(*table.type),
          offset_(valueOffset(type())),
          ring_(record + table.value),
          times_(placeIn<std::int64_t>(record, table.queue->times)),
          oldest_(placeIn<std::int64_t>(record, table.queue->oldest)),
          count_(placeIn<std::int64_t>(record, table.queue->count)),
          dropped_(placeIn<std::int64_t>(record, table.queue->dropped)),
          connected_(placeIn<bool>(record, table.connected)),
          capacity_(table.queue->size) {}

    static std::unique_ptr<Slots> slotsOf(const InputTable& table) {
        const detail::ConstructionScope on_heap(nullptr);  // the component's values lie together
        auto slots = std::make_unique<Slots>();
        for (std::int64_t i = 0; i < table.queue->size; ++i)
            slots->push_back(typeInfoOf(*table.type).make_slot(nullptr));
        return slots;
    }
    static SlotHeader* at(void* slots, std::size_t index) {
        return (*static_cast<Slots*>(slots))[index].get();
    }

    const Component* owner_;
    std::unique_ptr<Slots> slots_;
    ValueCopy copy_;
    std::size_t offset_;
    std::byte* ring_;
    std::int64_t* times_;
    std::int64_t* oldest_;
    std::int64_t* count_;
    std::int64_t* dropped_;
    bool* connected_;
    std::int64_t capacity_;
    std::uint64_t lost_ = 0;
};

}  // namespace rtcf::python
