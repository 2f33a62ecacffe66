/// @file
/// Ports: the inputs and outputs by which components exchange values. Declare them as members; they
/// register themselves with their component. Inside a runner, a connection is a pointer to the
/// writer's value: there is no copy.
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

/// Result of a read. The values are ordered: `status >= DataStatus::Old` means "there is a value".
enum class DataStatus {
    None,  ///< never written
    Old,   ///< not written since this input's last read
    New,   ///< written since this input's last read
};

/// Name, type and connection of a port. Kept outside the port object, so that the members that each
/// cycle touches lie close together in the processor's caches.
struct PortIdentity {
    Component* owner;
    std::string name;
    std::string unit;
    const TypeInfo& type;
    bool connected = false;  ///< an input has a writer; an output has a reader
    /// Inputs: the value is of an earlier writer, and the component has not read it yet.
    bool kept_is_new = false;
    QueueBase* queue = nullptr;  ///< inputs: the input itself if it is a Queue
};

/// Base class of inputs of all types.
class InputBase {
   public:
    InputBase(Component* owner, std::string name, const TypeInfo& type, const SlotHeader& empty);
    InputBase(const InputBase&) = delete;
    InputBase& operator=(const InputBase&) = delete;

    /// Name within the component. Real-time safe.
    const std::string& name() const noexcept { return identity_->name; }
    /// Description of the value's type. Real-time safe.
    const TypeInfo& type() const noexcept { return identity_->type; }

    /// True if an output or a ROS topic feeds this input. Real-time safe.
    bool connected() const noexcept RTCF_NONBLOCKING { return identity_->connected; }
    /// Loop time since the current value was written, ns; -1 if there is none. Real-time safe.
    std::int64_t age() const noexcept RTCF_NONBLOCKING;
    /// Sequence number, in the source, of the last value that this input has read. Real-time safe.
    std::uint64_t seen() const noexcept RTCF_NONBLOCKING { return seen_; }

    /// @name For the executor, at a cycle boundary; real-time safe
    /// @{
    /// This input as a queue; null if it is none.
    QueueBase* queue() const noexcept RTCF_NONBLOCKING { return identity_->queue; }
    /// Connects the input to `source`. The last value stays until the new writer writes; if the
    /// component has not read it, it is still new data.
    /// @param continued `source` is another slot with values of the same writer
    void rewire(const SlotHeader* source, bool continued) noexcept RTCF_NONBLOCKING {
        if (continued) {
            // A value of an earlier writer stays.
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
    /// Removes the writer; the last value stays.
    void disconnect() noexcept RTCF_NONBLOCKING { identity_->connected = false; }
    /// Sets a value that arrived from outside the loop, in `source`. The slot of the previous value
    /// is free again.
    void inject(const SlotHeader* source) noexcept RTCF_NONBLOCKING {
        source_ = source;
        current_ = source;
    }
    /// The slot with the newest value: the one that the next read() returns.
    const SlotHeader& newest() const noexcept {
        return source_->sequence != seen_ ? *source_ : *current_;
    }
    /// The slot with the value of the last read().
    const SlotHeader* current() const noexcept RTCF_NONBLOCKING { return current_; }
    /// Read position of the component.
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
    const SlotHeader* source_;   // slot of the writer
    const SlotHeader* current_;  // slot of the value of the last read
    std::uint64_t seen_ = 0;     // source_->sequence at the last read
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

    /// Makes the newest value the one that value() returns. Real-time safe.
    DataStatus read() noexcept RTCF_NONBLOCKING { return readStatus(); }

    /// Like read(), and copies the value if it is new; with `copy_old`, also an old one. Real-time
    /// safe if the assignment of T is.
    DataStatus read(T& copy, bool copy_old = true) {
        const DataStatus status = readStatus();
        if (status == DataStatus::New || (copy_old && status == DataStatus::Old)) copy = value();
        return status;
    }

    /// The value of the last read(); default-constructed before the first value. The reference is
    /// valid until update() returns. Real-time safe.
    const T& value() const noexcept RTCF_NONBLOCKING {
        return static_cast<const Slot<T>*>(current())->value;
    }

   private:
    static const SlotHeader& empty() {
        static const Slot<T> slot{};
        return slot;
    }
};

/// Base class of outputs of all types.
class OutputBase {
   public:
    OutputBase(Component* owner, std::string name, std::string unit, const TypeInfo& type,
               const Finite* finite);
    OutputBase(const OutputBase&) = delete;
    OutputBase& operator=(const OutputBase&) = delete;

    /// Name within the component. Real-time safe.
    const std::string& name() const noexcept { return rest_->identity.name; }
    /// Unit of the value, e.g. "N m". Real-time safe.
    const std::string& unit() const noexcept { return rest_->identity.unit; }
    /// Description of the value's type. Real-time safe.
    const TypeInfo& type() const noexcept { return rest_->identity.type; }
    /// True if an input or a ROS topic reads this output. Real-time safe.
    bool connected() const noexcept RTCF_NONBLOCKING { return rest_->identity.connected; }
    /// Sets connected(). For the executor, at a cycle boundary. Real-time safe.
    void setConnected(bool connected) noexcept RTCF_NONBLOCKING {
        rest_->identity.connected = connected;
    }
    /// The slot that readers see. It may outlive the component while an input refers to it.
    /// Real-time safe.
    const std::shared_ptr<SlotHeader>& slot() const noexcept { return rest_->slot; }
    /// The slot that the component writes: slot(), or the staged one. For the executor. Real-time
    /// safe.
    SlotHeader* written() const noexcept RTCF_NONBLOCKING { return raw_; }
    /// A slot with the capacity set by reserve(), to make copies of the output's values from. For
    /// the executor; not real-time.
    const SlotHeader* sample() const noexcept {
        return rest_->sample != nullptr ? rest_->sample.get() : rest_->slot.get();
    }
    /// Sets the clock that stamps written values. For the executor; not real-time.
    void setClock(const LoopClock& clock) noexcept { clock_ = &clock; }

    /// @name Staged outputs; for the executor
    /// Readers of a staged output see a written value only after commit(). Outputs declared Finite
    /// are staged, and so are those that the executor stages.
    /// @{
    bool staged() const noexcept RTCF_NONBLOCKING { return rest_->staged != nullptr; }
    /// True if the output is declared Finite. Real-time safe.
    bool checked() const noexcept RTCF_NONBLOCKING { return rest_->checked; }
    /// Stages the output. Only before it has readers. Not real-time safe.
    void stage() {
        if (rest_->staged != nullptr) return;
        // The component may hold a reference to its value, so it keeps the object; readers get a
        // new one.
        std::shared_ptr<SlotHeader> seen = type().make_slot(sample());
        type().copy(*seen, *rest_->slot);
        rest_->staged = std::exchange(rest_->slot, std::move(seen));
        rest_->examined = rest_->staged->sequence;
    }
    /// Publishes the written value to readers. Called after update(). Real-time safe if
    /// TypeInfo::copy is.
    /// @return false if the output is declared Finite and the value is not finite; readers keep the
    /// previous value
    /// @throws any exception of a copy; readers then have the previous value or the new one
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
        type().copy(*rest.staged, *rest.slot);  // the component keeps the value that it wrote
        return true;
    }
    /// Hides the value written since the last commit() from readers. Real-time safe.
    void discard() noexcept RTCF_NONBLOCKING { rest_->examined = rest_->staged->sequence; }
    /// Like discard(), and resets the component's value to the one that readers see. Real-time safe
    /// if TypeInfo::copy is.
    /// @throws any exception of a copy
    void takeBack() {
        discard();
        type().copy(*rest_->staged, *rest_->slot);
        discard();
    }
    /// Policy for values that are not finite. Real-time safe.
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
    SlotHeader* raw_;  // the slot that write() fills: rest_->staged, or rest_->slot

   private:
    struct Rest {
        PortIdentity identity;
        std::shared_ptr<SlotHeader> slot;
        std::shared_ptr<SlotHeader> staged;  // null = readers see written values at once
        std::shared_ptr<SlotHeader> sample;  // null = reserve() was not called
        bool checked = false;                // declared Finite
        std::uint64_t examined = 0;          // staged->sequence at the last check
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
    /// @param unit  unit of the value, for people
    Output(Component* owner, std::string name, std::string unit = {})
        : OutputBase(owner, std::move(name), std::move(unit), typeInfo<T>(), nullptr) {}
    /// An output whose values the executor checks for NaN and infinity before readers see them.
    Output(Component* owner, std::string name, std::string unit, Finite finite)
        : OutputBase(owner, std::move(name), std::move(unit), typeInfo<T>(), &finite) {
        detail::requireCheckable<T>();
    }

    /// Writes a value and stamps it with the loop's time. Real-time safe if the assignment of T is;
    /// for messages of variable size, only up to the size given to reserve().
    void write(const T& value) noexcept(std::is_nothrow_copy_assignable_v<T>) {
        static_cast<Slot<T>*>(raw_)->value = value;
        stampWrite();
    }

    /// The value in place: change it, then call publish(). Real-time safe.
    T& value() noexcept RTCF_NONBLOCKING { return static_cast<Slot<T>*>(raw_)->value; }
    /// Stamps the value changed in place as a new value. Real-time safe.
    void publish() noexcept RTCF_NONBLOCKING { stampWrite(); }

    /// Reserves memory for values up to the size of `sample`, so that writing them does not
    /// allocate. In the constructor or in configure(); not real-time safe.
    void reserve(const T& sample) {
        static_cast<Slot<T>*>(raw_)->value = sample;
        static_cast<Slot<T>*>(slot().get())->value = sample;
        if constexpr (!PortType<T>::kFixedSize) setSample(type().make_slot(slot().get()));
    }
};

}  // namespace rtcf
