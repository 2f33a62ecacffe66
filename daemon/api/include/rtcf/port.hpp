/// @file
/// Ports: how components exchange values. Declare them as members; they
/// register themselves with their component. Inside a runner a connection is a
/// pointer to the writer's value.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "rtcf/any_type.hpp"
#include "rtcf/arithmetic_type.hpp"
#include "rtcf/message_type.hpp"
#include "rtcf/port_type.hpp"
#include "rtcf/realtime.hpp"
#include "rtcf/slot.hpp"

namespace rtcf {

class Component;
class QueueBase;

/// What a read found. Ordered, so that `status >= DataStatus::Old` means "there is a value".
enum class DataStatus {
    None,  ///< never written
    Old,   ///< nothing new since this input's last read
    New,   ///< written since this input's last read
};

/// What a port is. Kept apart from what the cycle touches, so that the ports of
/// a component lie close together in the processor's caches.
struct PortIdentity {
    Component* owner;
    std::string name;
    std::string unit;
    const TypeInfo& type;
    bool connected = false;  ///< an input's: something feeds it; an output's: something reads it
    bool kept_is_new =
        false;  ///< an input's: its component has not read what an earlier writer left
    QueueBase* queue = nullptr;  ///< an input's that keeps every message: itself
};

/// What the executor handles of any input.
class InputBase {
   public:
    InputBase(Component* owner, std::string name, const TypeInfo& type, const SlotHeader& empty);
    InputBase(const InputBase&) = delete;
    InputBase& operator=(const InputBase&) = delete;

    const std::string& name() const noexcept { return identity_->name; }
    const TypeInfo& type() const noexcept { return identity_->type; }

    /// True if an output or a ROS topic feeds this input. Real-time safe.
    bool connected() const noexcept RTCF_NONBLOCKING { return identity_->connected; }
    /// Loop time since the current value was written, ns; -1 without a value. Real-time safe.
    std::int64_t age() const noexcept RTCF_NONBLOCKING;
    /// Writes of its source that this input has read so far. Real-time safe.
    std::uint64_t seen() const noexcept RTCF_NONBLOCKING { return seen_; }

    /// @name For the executor, at a cycle boundary
    /// @{
    /// Itself as a queue; null if it is none.
    QueueBase* queue() const noexcept RTCF_NONBLOCKING { return identity_->queue; }
    /// Reads from `source` on. A new writer's value counts once it writes; until then the last
    /// value stays, as new data if it has not been read. `continued`: the same writer's values by
    /// another slot.
    void rewire(const SlotHeader* source, bool continued) noexcept RTCF_NONBLOCKING {
        if (continued) {
            // A value kept of an earlier writer stays, as before.
            if (current_ == source_) current_ = source;
        } else if (current_->sequence == 0 && seen_ == 0) {
            current_ = source;
        } else {
            if (source_->sequence != seen_) {
                current_ = source_;
                identity_->kept_is_new = true;
            }
            seen_ = source->sequence;
        }
        source_ = source;
        identity_->connected = true;
    }
    /// Has no writer any more; the present value stays.
    void disconnect() noexcept RTCF_NONBLOCKING { identity_->connected = false; }
    /// A value from outside the loop has arrived in `source`; the slot of the last one is given
    /// back.
    void inject(const SlotHeader* source) noexcept RTCF_NONBLOCKING {
        source_ = source;
        current_ = source;
    }
    /// The slot whose value the component has, or would get by read().
    const SlotHeader& newest() const noexcept {
        return source_->sequence != seen_ ? *source_ : *current_;
    }
    /// The slot whose value the component has.
    const SlotHeader* current() const noexcept RTCF_NONBLOCKING { return current_; }
    /// How far the component has read.
    struct Reading {
        const SlotHeader* source = nullptr;
        const SlotHeader* current = nullptr;
        std::uint64_t seen = 0;
        bool kept_is_new = false;
    };
    Reading reading() const noexcept RTCF_NONBLOCKING {
        return {source_, current_, seen_, identity_->kept_is_new};
    }
    void setReading(const Reading& reading) noexcept RTCF_NONBLOCKING {
        source_ = reading.source;
        current_ = reading.current;
        seen_ = reading.seen;
        identity_->kept_is_new = reading.kept_is_new;
    }
    /// @}

   protected:
    ~InputBase() = default;

    Component& owner() const noexcept RTCF_NONBLOCKING { return *identity_->owner; }

    void setQueue(QueueBase* queue) noexcept { identity_->queue = queue; }

    DataStatus readStatus() noexcept RTCF_NONBLOCKING {
        if (__builtin_expect(static_cast<long>(source_->sequence != seen_), 1) != 0) {
            seen_ = source_->sequence;
            current_ = source_;
            return DataStatus::New;
        }
        if (current_ != source_ && std::exchange(identity_->kept_is_new, false))
            return DataStatus::New;
        return current_->sequence != 0 ? DataStatus::Old : DataStatus::None;
    }

   private:
    friend struct AbiProbe;
    const SlotHeader* source_;   // where the writer writes
    const SlotHeader* current_;  // where the component's value is
    std::uint64_t seen_ = 0;     // the source's sequence at the last read
    std::unique_ptr<PortIdentity> identity_;
};

/// An input port carrying values of type T.
template <typename T>
class Input final : public InputBase {
   public:
    /// @param owner the component, `this`
    /// @param name  ROS base name, unique among the component's ports
    Input(Component* owner, std::string name)
        : InputBase(owner, std::move(name), typeInfo<T>(), empty()) {}

    /// Takes note of the newest value, which value() then gives. Real-time safe.
    DataStatus read() noexcept RTCF_NONBLOCKING { return readStatus(); }

    /// As read(), and copies the value if there is a new one, or any with `copy_old`.
    /// Real-time safe for types whose assignment is.
    DataStatus read(T& copy, bool copy_old = true) {
        const DataStatus status = readStatus();
        if (status == DataStatus::New || (copy_old && status == DataStatus::Old)) copy = value();
        return status;
    }

    /// The value of the last read(); default-constructed before there was one. Real-time safe.
    const T& value() const noexcept RTCF_NONBLOCKING {
        return static_cast<const Slot<T>*>(current())->value;
    }

   private:
    static const SlotHeader& empty() {
        static const Slot<T> slot{};
        return slot;
    }
};

/// What the executor handles of any output.
class OutputBase {
   public:
    OutputBase(Component* owner, std::string name, std::string unit, const TypeInfo& type,
               const Finite* finite);
    OutputBase(const OutputBase&) = delete;
    OutputBase& operator=(const OutputBase&) = delete;

    const std::string& name() const noexcept { return rest_->identity.name; }
    const std::string& unit() const noexcept { return rest_->identity.unit; }
    const TypeInfo& type() const noexcept { return rest_->identity.type; }
    /// True if an input or a ROS topic gets what this output writes. Real-time safe.
    bool connected() const noexcept RTCF_NONBLOCKING { return rest_->identity.connected; }
    /// For the executor, at a cycle boundary. Real-time safe.
    void setConnected(bool connected) noexcept RTCF_NONBLOCKING {
        rest_->identity.connected = connected;
    }
    /// The slot that this output writes; inputs may keep it alive beyond the component.
    const std::shared_ptr<SlotHeader>& slot() const noexcept { return rest_->slot; }
    /// What the component writes into: the slot, or the staged one. For the executor.
    SlotHeader* written() const noexcept RTCF_NONBLOCKING { return raw_; }
    /// A slot with the capacity that reserve() gave this output, for copies of its values.
    const SlotHeader* sample() const noexcept {
        return rest_->sample != nullptr ? rest_->sample.get() : rest_->slot.get();
    }
    /// The clock that stamps what is written; for the executor.
    void setClock(const LoopClock& clock) noexcept { clock_ = &clock; }

    /// @name Of an output that is staged, as one declared Finite is; for the executor
    /// @{
    bool staged() const noexcept RTCF_NONBLOCKING { return rest_->staged != nullptr; }
    /// True if it is declared Finite.
    bool checked() const noexcept RTCF_NONBLOCKING { return rest_->checked; }
    /// From here on readers see nothing before commit(). Before there are any; not real-time safe.
    void stage() {
        if (rest_->staged != nullptr) return;
        // The component keeps its object, to which it may have a reference; readers get the other.
        std::shared_ptr<SlotHeader> seen = type().make_slot(sample());
        type().copy(*seen, *rest_->slot);
        rest_->staged = std::exchange(rest_->slot, std::move(seen));
        rest_->examined = rest_->staged->sequence;
    }
    /// Lets readers see what was written; if it is declared Finite, only a finite value. After
    /// update(); real-time safe as TypeInfo::copy is. @return false if it is not
    /// @throws any exception of a copy; readers then have the previous value, or this one
    bool commit() {
        Rest& rest = *rest_;
        if (rest.staged->sequence == rest.examined) return true;
        rest.examined = rest.staged->sequence;
        if (rest.checked && !type().finite(*rest.staged)) return false;
        if (type().flat) {
            type().copy(*rest.slot, *rest.staged);
            return true;
        }
        type().exchange(*rest.slot, *rest.staged);
        *rest.slot = *rest.staged;
        type().copy(*rest.staged, *rest.slot);  // the component goes on from the value it wrote
        return true;
    }
    /// What was written since the last commit() is never seen. Real-time safe.
    void discard() noexcept RTCF_NONBLOCKING { rest_->examined = rest_->staged->sequence; }
    /// As discard(), and the component has the last value that readers saw. Real-time safe as
    /// TypeInfo::copy is. @throws any exception of a copy
    void takeBack() {
        discard();
        type().copy(*rest_->staged, *rest_->slot);
        discard();
    }
    OnNonFinite nonFinitePolicy() const noexcept RTCF_NONBLOCKING { return rest_->policy; }
    /// @}

   protected:
    ~OutputBase() = default;

    void setSample(std::shared_ptr<SlotHeader> sample) noexcept {
        rest_->sample = std::move(sample);
    }
    void stampWrite() noexcept RTCF_NONBLOCKING {
        ++raw_->sequence;
        raw_->time_ns = clock_->time_ns;
    }

    friend struct AbiProbe;
    SlotHeader* raw_;  // what is written: the slot's object, or the staged one's

   private:
    struct Rest {
        PortIdentity identity;
        std::shared_ptr<SlotHeader> slot;
        std::shared_ptr<SlotHeader> staged;  // null = readers see at once what is written
        std::shared_ptr<SlotHeader> sample;  // null = none was given to reserve()
        bool checked = false;                // declared Finite
        std::uint64_t examined = 0;          // the staged one's sequence at the last check
        OnNonFinite policy = OnNonFinite::Hold;
    };

    const LoopClock* clock_;
    std::unique_ptr<Rest> rest_;
};

/// An output port carrying values of type T.
template <typename T>
class Output final : public OutputBase {
   public:
    /// @param owner the component, `this`
    /// @param name  ROS base name, unique among the component's ports
    /// @param unit  what a value means, for people
    Output(Component* owner, std::string name, std::string unit = {})
        : OutputBase(owner, std::move(name), std::move(unit), typeInfo<T>(), nullptr) {}
    /// An output whose values are checked for NaN and infinity before anybody reads them.
    Output(Component* owner, std::string name, std::string unit, Finite finite)
        : OutputBase(owner, std::move(name), std::move(unit), typeInfo<T>(), &finite) {
        detail::requireCheckable<T>();
    }

    /// Writes a value. Real-time safe for types whose assignment is; for messages
    /// of variable size once reserve() has been given the largest one.
    void write(const T& value) noexcept(std::is_nothrow_copy_assignable_v<T>) {
        static_cast<Slot<T>*>(raw_)->value = value;
        stampWrite();
    }

    /// The value in place, to be changed and then published. Real-time safe.
    T& value() noexcept RTCF_NONBLOCKING { return static_cast<Slot<T>*>(raw_)->value; }
    /// Makes what value() gave a new value. Real-time safe.
    void publish() noexcept RTCF_NONBLOCKING { stampWrite(); }

    /// Takes the capacity of `sample`, so that later values up to its size are
    /// written without allocation. For constructor and configure(); not real-time safe.
    void reserve(const T& sample) {
        static_cast<Slot<T>*>(raw_)->value = sample;
        static_cast<Slot<T>*>(slot().get())->value = sample;
        if constexpr (!PortType<T>::kFixedSize) setSample(type().make_slot(slot().get()));
    }
};

}  // namespace rtcf
