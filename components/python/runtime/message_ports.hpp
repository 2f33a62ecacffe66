/// @file
/// Ports of ROS messages. In each cycle they copy the numbers that hooks use between the message
/// and the component's record. The adapter of the message provides its tables.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>

#include "message_fields.hpp"
#include "port_type.hpp"
#include "value_ports.hpp"

namespace rtcf::python {

/// Input that provides the newest message.
class MessageInput final : public InputBase {
   public:
    MessageInput(Component* owner, const InputTable& table, std::byte* record)
        : InputBase(owner, table.name, table.message->type(), emptySlot(table.message->type()),
                    {table.unit, table.doc}),
          owner_(*owner),
          fields_(*table.message, table.leaves, table.leaf_count),
          offset_(valueOffset(table.message->type())),
          record_(record),
          flags_(placeIn<bool>(record, table.flags)),
          age_(placeIn<std::int64_t>(record, table.age)),
          connected_(placeIn<bool>(record, table.connected)),
          too_large_(table.too_large) {}

    /// Copies the newest message to the record; ignores a message with too many elements, and logs
    /// a warning. Real-time safe.
    void read() noexcept {
        const DataStatus status = readStatus();
        const void* const message = reinterpret_cast<const std::byte*>(&slot()) + offset_;
        const bool fits = fields_.fit(message);
        flags_[0] = fits && status == DataStatus::New;
        if (fits && status != DataStatus::None) {
            flags_[1] = true;
            fields_.toRecord(record_, message);
            if (age_ != nullptr) *age_ = age(&owner_);
        } else if (!fits && status == DataStatus::New) {
            warn();
        }
        if (connected_ != nullptr) *connected_ = connected(&owner_);
    }

   private:
    // Logs at most once a second.
    void warn() noexcept {
        if (owner_.logs(too_large_.level) &&
            detail::logThrottle(next_warning_ns_, owner_.time(), kWarnPeriod))
            detail::logCall(owner_.logSink(), owner_.fullName().c_str(), too_large_);
    }

    static constexpr std::int64_t kWarnPeriod = 1'000'000'000;

    const Component& owner_;
    MessageFields fields_;
    std::size_t offset_;
    std::byte* record_;
    bool* flags_;
    std::int64_t* age_;
    bool* connected_;
    const LogSite& too_large_;  // in the library's tables: log records point to it
    std::atomic<std::int64_t> next_warning_ns_{std::numeric_limits<std::int64_t>::min()};
};

/// Output of messages.
class MessageOutput final : public OutputBase {
   public:
    MessageOutput(Component* owner, const OutputTable& table, std::byte* record)
        : MessageOutput(owner, table, record, Finite()) {
        reserve(table);
    }

    /// Publishes the message of the record if a hook called publish(). Real-time safe.
    void write() noexcept {
        if (!*written_) return;
        fields_.toMessage(reinterpret_cast<std::byte*>(raw_) + offset_, record_);
        stampWrite();
        *written_ = false;
    }

    /// Discards a publish() of a hook. Real-time safe.
    void forget() noexcept { *written_ = false; }

   private:
    MessageOutput(Component* owner, const OutputTable& table, std::byte* record,
                  const Finite& finite)
        : OutputBase(owner, table.name, {table.unit, table.doc}, table.message->type(),
                     table.finite != 0 ? &finite : nullptr),
          fields_(*table.message, table.leaves, table.leaf_count),
          offset_(valueOffset(port().type())),
          record_(record),
          written_(placeIn<bool>(record, table.written)) {}

    /// Sets the sizes of the message and its constant strings, as rtcf::Output::reserve() does.
    void reserve(const OutputTable& table) {
        const TypeInfo& type = port().type();
        const std::shared_ptr<SlotHeader> sample = type.make_slot(nullptr);
        void* const message = reinterpret_cast<std::byte*>(sample.get()) + offset_;
        fields_.resize(message);
        for (std::int64_t i = 0; i < table.text_count; ++i)
            setText(message, *table.message, table.texts[i]);
        type.copy(*raw_, *sample);
        type.copy(*port().slot(), *sample);
        if (!type.fixed_size) port().setSample(type.make_slot(sample.get()));
    }

    MessageFields fields_;
    std::size_t offset_;
    const std::byte* record_;
    bool* written_;
};

}  // namespace rtcf::python
