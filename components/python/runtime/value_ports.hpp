/// @file
/// Ports of numbers and arrays. In the cycle they go between slots and the component's record.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "port_type.hpp"
#include "value_copy.hpp"

namespace rtcf::python {

/// A place in the record, null for an offset of -1.
template <typename T>
T* placeIn(std::byte* record, std::int64_t offset) noexcept {
    return offset < 0 ? nullptr : reinterpret_cast<T*>(record + offset);
}

/// An input whose newest value counts.
class ValueInput final : public InputBase {
   public:
    ValueInput(Component* owner, const InputTable& table, std::byte* record)
        : InputBase(owner, table.name, typeInfoOf(*table.type), emptySlot(typeInfoOf(*table.type))),
          offset_(valueOffset(type())),
          field_(record + table.value),
          flags_(placeIn<bool>(record, table.flags)),
          copy_(*table.type),
          age_(placeIn<std::int64_t>(record, table.age)),
          connected_(placeIn<bool>(record, table.connected)),
          has_more_(age_ != nullptr || connected_ != nullptr) {}

    /// Brings the newest value into the record. Real-time safe.
    void read() noexcept {
        const DataStatus status = readStatus();
        flags_[0] = status == DataStatus::New;
        flags_[1] = status != DataStatus::None;
        copy_.toRecord(field_, reinterpret_cast<const std::byte*>(current()) + offset_);
        if (has_more_) readMore();
    }

   private:
    __attribute__((noinline)) void readMore() noexcept {
        if (age_ != nullptr) *age_ = age();
        if (connected_ != nullptr) *connected_ = connected();
    }

    std::size_t offset_;
    std::byte* field_;
    bool* flags_;
    ValueCopy copy_;
    std::int64_t* age_;
    bool* connected_;
    bool has_more_;
};

/// An output.
class ValueOutput final : public OutputBase {
   public:
    ValueOutput(Component* owner, const OutputTable& table, std::byte* record)
        : ValueOutput(owner, table, record, Finite()) {}

    /// Writes the record's value, if a hook has written one. Real-time safe.
    void write() noexcept {
        if (!*written_) return;
        copy_.toPort(reinterpret_cast<std::byte*>(raw_) + offset_, field_);
        stampWrite();
        *written_ = false;
    }

    /// Forgets what a hook has written. Real-time safe.
    void forget() noexcept { *written_ = false; }

   private:
    ValueOutput(Component* owner, const OutputTable& table, std::byte* record, const Finite& finite)
        : OutputBase(owner, table.name, table.unit, typeInfoOf(*table.type),
                     table.finite != 0 ? &finite : nullptr),
          copy_(*table.type),
          offset_(valueOffset(type())),
          field_(record + table.value),
          written_(placeIn<bool>(record, table.written)) {}

    ValueCopy copy_;
    std::size_t offset_;
    const std::byte* field_;
    bool* written_;
};

/// An input that keeps each message, as a ring in the record, which hooks take from.
class QueuePort final : public QueueBase {
   public:
    QueuePort(Component* owner, const InputTable& table, std::byte* record)
        : QueuePort(owner, table, record, slotsOf(table)) {}

    /// Moves new messages into the record's ring; those that find it full are lost. Real-time safe.
    void read() noexcept {
        const std::int64_t now_ns = owner().time();
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
        : QueueBase(owner, table.name, typeInfoOf(*table.type), *slots->front(),
                    {slots->size(), &at, slots.get()}),
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
        auto slots = std::make_unique<Slots>();
        for (std::int64_t i = 0; i < table.queue->size; ++i)
            slots->push_back(typeInfoOf(*table.type).make_slot(nullptr));
        return slots;
    }
    static SlotHeader* at(void* slots, std::size_t index) {
        return (*static_cast<Slots*>(slots))[index].get();
    }

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
