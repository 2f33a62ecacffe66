/// @file
/// Ports: the inputs and outputs by which components exchange values. Declare them as members; they
/// register themselves with their component. Inside a runner, a connection is a pointer to the
/// writer's value: there is no copy.
///
/// A value belongs to the loop time at which it was written or arrived, its stamp:
///
///     written in                        stamp                            the first read() returns
///     update(), safe()                  the cycle                        New
///     start()                           the start                        New
///     takeOver()                        just before the next cycle       New
///     from outside, the loop runs       the cycle that takes it          New
///     from outside, before the start    its arrival                      Old; queues drop it
///     in place                          the cycle of publish()           New, not before
///
/// The rule for each input: it reads the value of its writer if there is one. While the writer has
/// not written, the input keeps the value of an earlier writer, with its age. New means that this
/// input has not read the value, so it does not depend on other readers; only values from outside
/// that are older than the start or than the input's connection begin as Old.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>

#include "rtcf/any_type.hpp"
#include "rtcf/arithmetic_type.hpp"
#include "rtcf/component_memory.hpp"
#include "rtcf/member_owners.hpp"
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

/// What a port's value is, for people.
struct PortTexts {
    std::string unit;  ///< e.g. "N m"; empty = none
    std::string doc;   ///< one line; empty = none
};

/// Base class of inputs of all types. It has only the members that each cycle touches; an InputPort
/// has the others.
class InputBase {
   public:
    /// Declares the input to its owner.
    InputBase(Component* owner, std::string name, const TypeInfo& type, const SlotHeader& empty,
              PortTexts texts = {});
    InputBase(const InputBase&) = delete;
    InputBase& operator=(const InputBase&) = delete;

    /// True if there is a value. Real-time safe.
    bool hasValue() const noexcept RTCF_NONBLOCKING { return source_->stamp != 0; }
    /// True if the next read() returns DataStatus::New. Real-time safe.
    bool isNew() const noexcept RTCF_NONBLOCKING { return source_->stamp != seen_; }
    /// Loop time since the newest value was written, ns; -1 if there is none. Real-time safe.
    /// @param owner the component, `this`
    std::int64_t age(const Component* owner) const noexcept RTCF_NONBLOCKING;
    /// True if there is a writer, even if it has not written yet: an output of this runner, or, if
    /// none writes the input, a ROS node that publishes the topic, or a client that has written.
    /// False when the node has ended: within 0.2 s, but after minutes if its machine or the network
    /// has failed, see age(). Real-time safe.
    /// @param owner the component, `this`
    bool connected(const Component* owner) const noexcept RTCF_NONBLOCKING;

   protected:
    ~InputBase() { detail::endMember(this); }

    DataStatus readStatus() noexcept RTCF_NONBLOCKING {
        const std::int64_t stamp = source_->stamp;
        if (__builtin_expect(static_cast<long>(stamp != seen_), 1) != 0) {
            seen_ = stamp;
            return DataStatus::New;
        }
        return stamp != 0 ? DataStatus::Old : DataStatus::None;
    }
    /// The slot with the newest value.
    const SlotHeader& slot() const noexcept RTCF_NONBLOCKING { return *source_; }
    void skipValue() noexcept RTCF_NONBLOCKING { seen_ = source_->stamp; }

   private:
    friend struct AbiProbe;
    friend class InputPort;
    const SlotHeader* source_;
    std::int64_t seen_ = 0;  // stamp of the value of the last read()
};

/// Name, type, texts and connection of an input. Owned by the component, but kept outside its
/// object, so that the members that each cycle touches lie close together in the processor's
/// caches. For the executor.
class InputPort {
   public:
    InputPort(InputBase& input, const Component& owner, std::string name, const TypeInfo& type,
              PortTexts texts)
        : input_(input),
          owner_(owner),
          name_(std::move(name)),
          type_(type),
          texts_(std::move(texts)) {}
    InputPort(const InputPort&) = delete;
    InputPort& operator=(const InputPort&) = delete;

    /// Name within the component. Real-time safe.
    const std::string& name() const noexcept { return name_; }
    /// Unit and meaning of the value. Real-time safe.
    const PortTexts& texts() const noexcept { return texts_; }
    /// Description of the value's type. Real-time safe.
    const TypeInfo& type() const noexcept { return type_; }
    const Component& owner() const noexcept RTCF_NONBLOCKING { return owner_; }
    const InputBase& input() const noexcept RTCF_NONBLOCKING { return input_; }
    /// This input as a queue; null if it is none. Real-time safe.
    QueueBase* queue() const noexcept RTCF_NONBLOCKING { return queue_; }
    void setQueue(QueueBase* queue) noexcept { queue_ = queue; }
    /// True if the input has a writer, see InputBase::connected(). Real-time safe.
    bool connected() const noexcept RTCF_NONBLOCKING {
        return connected_ && (fed_ == nullptr || *fed_);
    }

    /// @name Cycle thread; real-time safe
    /// @{
    /// The slot with the value that the next read() returns.
    const SlotHeader& slot() const noexcept RTCF_NONBLOCKING { return *input_.source_; }
    /// Stamp of the value of the last read().
    std::int64_t seen() const noexcept RTCF_NONBLOCKING { return input_.seen_; }

    /// Connects the input to an output's slot. If the writer has not written, the input keeps its
    /// value until then, see connectWritten(); a queue has copies and does not wait.
    /// @param continued `source` is another slot with values of the same writer
    void connect(const SlotHeader* source, bool continued) noexcept RTCF_NONBLOCKING {
        connected_ = true;
        fed_ = nullptr;
        if (continued) {
            if (waiting()) {
                awaited_ = source;
            } else {
                input_.source_ = source;
            }
            return;
        }
        connectWritten();  // the value of the present writer, if it has written
        if (queue_ != nullptr || input_.source_->stamp == 0 || source->stamp != 0) {
            set(source, 0);
        } else {
            awaited_ = source;
        }
    }
    /// Connects the input to values from outside, of which `front` is the newest: an old one. If
    /// the input has a value, it keeps it until inject().
    /// @param fed whether somebody writes them; outlives the connection
    void connectOutside(const SlotHeader* front, const Shared<bool>* fed) noexcept
        RTCF_NONBLOCKING {
        connected_ = true;
        fed_ = fed;
        connectWritten();
        awaited_ = nullptr;
        if (queue_ != nullptr || input_.source_->stamp == 0) injectOld(front);
    }
    /// Removes the writer; the value stays.
    void disconnect() noexcept RTCF_NONBLOCKING {
        connectWritten();
        awaited_ = nullptr;
        connected_ = false;
        fed_ = nullptr;
    }
    /// Sets a new value that arrived from outside the loop, in `source`. The slot of the previous
    /// value is free again.
    void inject(const SlotHeader* source) noexcept RTCF_NONBLOCKING { set(source, 0); }
    /// The same for a value that is not new to a reader: it arrived before the start.
    void injectOld(const SlotHeader* source) noexcept RTCF_NONBLOCKING {
        set(source, source->stamp);
    }
    /// Ends the wait for a new writer if it has written.
    void connectWritten() noexcept RTCF_NONBLOCKING {
        const SlotHeader* const awaited = awaited_;
        if (awaited != nullptr && awaited->stamp != 0) set(awaited, 0);
    }
    /// Sets the value and the read position, to restore them.
    /// @param awaited slot of a new writer that has not written yet; null = none
    void set(const SlotHeader* source, std::int64_t seen,
             const SlotHeader* awaited = nullptr) noexcept RTCF_NONBLOCKING {
        input_.source_ = source;
        input_.seen_ = seen;
        awaited_ = awaited;
    }
    /// Follows a move of the loop's time by `by` ns.
    void moveTime(std::int64_t by) noexcept RTCF_NONBLOCKING {
        input_.seen_ = movedStamp(input_.seen_, by);
    }
    /// @}

    /// True if the input keeps a value of an earlier writer until the new one writes. Real-time
    /// safe; any thread.
    bool waiting() const noexcept RTCF_NONBLOCKING { return awaited_ != nullptr; }

   private:
    friend struct AbiProbe;
    InputBase& input_;
    const Component& owner_;
    std::string name_;
    const TypeInfo& type_;
    QueueBase* queue_ = nullptr;
    bool connected_ = false;
    const Shared<bool>* fed_ = nullptr;  // null = a writer in this runner, or none
    Shared<const SlotHeader*> awaited_ = nullptr;
    PortTexts texts_;
};

/// An input port carrying values of type T.
template <typename T>
class Input final : public InputBase {
   public:
    /// @param owner the component, `this`
    /// @param name  ROS base name, unique among the component's ports
    /// @param unit  unit of the value, for people
    /// @param doc   what the value is, one line, for people
    Input(Component* owner, std::string name, std::string unit = {}, std::string doc = {})
        : InputBase(owner, std::move(name), typeInfo<T>(), empty(),
                    {std::move(unit), std::move(doc)}) {}

    /// Tells whether value() is new to this input: written since its last read(). Real-time safe.
    DataStatus read() noexcept RTCF_NONBLOCKING { return readStatus(); }

    /// Like read(), and copies the value if it is new; with `copy_old`, also an old one. Real-time
    /// safe if the assignment of T is.
    DataStatus read(T& copy, bool copy_old = true) {
        const DataStatus status = readStatus();
        if (status == DataStatus::New || (copy_old && status == DataStatus::Old)) copy = value();
        return status;
    }

    /// The newest value, whether it was read() or not; default-constructed before the first one. It
    /// does not change until update() returns. Real-time safe.
    const T& value() const noexcept RTCF_NONBLOCKING {
        return static_cast<const Slot<T>&>(slot()).value;
    }

   private:
    static const SlotHeader& empty() {
        static const Slot<T> slot{};
        return slot;
    }
};

class OutputPort;

/// Base class of outputs of all types. It has only the members that each cycle touches; an
/// OutputPort has the others.
class OutputBase {
   public:
    /// Declares the output to its owner.
    OutputBase(Component* owner, std::string name, PortTexts texts, const TypeInfo& type,
               const Finite* finite);
    OutputBase(const OutputBase&) = delete;
    OutputBase& operator=(const OutputBase&) = delete;

    /// Name within the component. Real-time safe.
    const std::string& name() const noexcept;
    /// Unit of the value, e.g. "N m". Real-time safe.
    const std::string& unit() const noexcept;
    /// True if an input or a ROS topic reads this output. Real-time safe.
    bool connected() const noexcept RTCF_NONBLOCKING;

   protected:
    ~OutputBase();

    OutputPort& port() const noexcept RTCF_NONBLOCKING { return *port_; }
    void stampWrite() noexcept RTCF_NONBLOCKING { raw_->stamp = *now_; }

    friend struct AbiProbe;
    SlotHeader* raw_;  // the slot that write() fills

   private:
    const Shared<std::int64_t>* now_;  // the component's time
    std::unique_ptr<OutputPort> port_;
};

/// Name, texts, slots and readers of an output. Kept outside the component's object, like
/// InputPort. For the executor.
class OutputPort {
   public:
    /// @param finite policy of an output that is declared Finite; null = it is not
    OutputPort(const OutputBase& output, std::string name, PortTexts texts, const TypeInfo& type,
               const Finite* finite)
        : output_(output),
          name_(std::move(name)),
          type_(type),
          slot_(type.make_slot(nullptr)),
          written_(slot_.get()),
          draft_(isShared(type) ? makeDraft(type) : slot_),
          texts_(std::move(texts)) {
        dropDraft();
        if (finite == nullptr) return;
        checked_ = true;
        policy_ = finite->policy;
        stage();
    }
    OutputPort(const OutputPort&) = delete;
    OutputPort& operator=(const OutputPort&) = delete;

    const OutputBase& output() const noexcept RTCF_NONBLOCKING { return output_; }
    /// Name within the component. Real-time safe.
    const std::string& name() const noexcept { return name_; }
    /// Unit and meaning of the value. Real-time safe.
    const PortTexts& texts() const noexcept { return texts_; }
    /// Unit of the value. Real-time safe.
    const std::string& unit() const noexcept { return texts_.unit; }
    /// Description of the value's type. Real-time safe.
    const TypeInfo& type() const noexcept { return type_; }
    /// True if the output has a reader. Real-time safe.
    bool connected() const noexcept RTCF_NONBLOCKING { return connected_; }
    /// Sets connected(). At a cycle boundary. Real-time safe.
    void setConnected(bool connected) noexcept RTCF_NONBLOCKING { connected_ = connected; }

    /// The slot that readers see. It may outlive the component while an input refers to it.
    /// Real-time safe.
    const std::shared_ptr<SlotHeader>& slot() const noexcept { return slot_; }
    /// The slot that the component writes: slot(), or the staged one. Real-time safe.
    SlotHeader* written() const noexcept RTCF_NONBLOCKING { return written_; }
    /// The slot that the component changes in place until publish(). Real-time safe.
    SlotHeader& draft() const noexcept RTCF_NONBLOCKING { return *draft_; }
    /// Undoes changes in place that were not published. Real-time safe.
    void dropDraft() noexcept RTCF_NONBLOCKING {
        if (draft_.get() != written_) draft_->stamp = kNoDraft;
    }
    /// Follows a move of the loop's time by `by` ns. Real-time safe.
    void moveDraft(std::int64_t by) noexcept RTCF_NONBLOCKING {
        if (draft_.get() != written_ && draft_->stamp != kNoDraft)
            draft_->stamp = movedStamp(draft_->stamp, by);
    }
    /// A slot with the capacity set by reserve(), as the argument of TypeInfo::make_slot(). Not
    /// real-time.
    const SlotHeader* sample() const noexcept {
        return sample_ != nullptr ? sample_.get() : slot_.get();
    }
    void setSample(std::shared_ptr<SlotHeader> sample) noexcept { sample_ = std::move(sample); }

    /// @name Staged outputs
    /// Readers of a staged output see a written value only after commit(). Outputs declared Finite
    /// are staged, and so are those that the executor stages.
    /// @{
    bool staged() const noexcept RTCF_NONBLOCKING { return staged_ != nullptr; }
    /// True if the output is declared Finite. Real-time safe.
    bool checked() const noexcept RTCF_NONBLOCKING { return checked_; }
    /// Policy for values that are not finite. Real-time safe.
    OnNonFinite nonFinitePolicy() const noexcept RTCF_NONBLOCKING { return policy_; }
    /// Stages the output. Only before it has readers. Not real-time safe.
    void stage() {
        if (staged_ != nullptr) return;
        // The component may hold a reference to its value, so it keeps its slot; readers get a new
        // one.
        std::shared_ptr<SlotHeader> seen = type_.make_slot(sample());
        type_.copy(*seen, *slot_);
        staged_ = std::exchange(slot_, std::move(seen));
    }
    /// True if commit() publishes the written value: it is finite, or need not be. Real-time safe.
    bool valid() const noexcept {
        if (!checked_) return true;
        if (type_.is_double) return std::isfinite(static_cast<const Slot<double>&>(*staged_).value);
        return type_.finite(*staged_);
    }
    /// Publishes the written value to readers. Called after update(). Real-time safe if
    /// TypeInfo::copy is.
    /// @return false if the output is declared Finite and the value is not finite; readers keep the
    /// previous value
    /// @throws any exception of a copy; readers then have the previous value or the new one
    bool commit() {
        if (staged_->stamp == slot_->stamp) return true;
        if (!valid()) {
            discard();
            return false;
        }
        if (type_.is_double) {
            static_cast<Slot<double>&>(*slot_).value =
                static_cast<const Slot<double>&>(*staged_).value;
            slot_->stamp = staged_->stamp;
            return true;
        }
        if (type_.flat) {
            type_.copy(*slot_, *staged_);
            return true;
        }
        type_.exchange(*slot_, *staged_);
        *slot_ = *staged_;
        type_.copy(*staged_, *slot_);  // the component keeps the value that it wrote
        return true;
    }
    /// Hides the value written since the last commit() from readers. Real-time safe.
    void discard() noexcept RTCF_NONBLOCKING { staged_->stamp = slot_->stamp; }
    /// Like discard(), and resets the component's value to the one that readers see. Real-time safe
    /// if TypeInfo::copy is.
    /// @throws any exception of a copy
    void takeBack() {
        discard();
        type_.copy(*staged_, *slot_);
    }
    /// @}

   private:
    friend struct AbiProbe;
    static constexpr std::int64_t kNoDraft = INT64_MIN;  // differs from each stamp

    static std::shared_ptr<SlotHeader> makeDraft(const TypeInfo& type) {
        const detail::ConstructionScope on_heap(nullptr);  // the slots of readers lie together
        return type.make_slot(nullptr);
    }

    const OutputBase& output_;
    std::string name_;
    const TypeInfo& type_;
    std::shared_ptr<SlotHeader> slot_;
    std::shared_ptr<SlotHeader> staged_;  // null = readers see written values at once
    std::shared_ptr<SlotHeader> sample_;  // null = reserve() was not called
    SlotHeader* const written_;
    // Of a value that readers may share; otherwise written_.
    const std::shared_ptr<SlotHeader> draft_;
    bool connected_ = false;
    bool checked_ = false;  // declared Finite
    OnNonFinite policy_ = OnNonFinite::Hold;
    PortTexts texts_;
};

inline OutputBase::~OutputBase() { detail::endMember(this); }
inline const std::string& OutputBase::name() const noexcept { return port_->name(); }
inline const std::string& OutputBase::unit() const noexcept { return port_->unit(); }
inline bool OutputBase::connected() const noexcept RTCF_NONBLOCKING { return port_->connected(); }

/// An output port carrying values of type T.
template <typename T>
class Output final : public OutputBase {
   public:
    /// @param owner the component, `this`
    /// @param name  ROS base name, unique among the component's ports
    /// @param unit  unit of the value, for people
    /// @param doc   what the value is, one line, for people
    Output(Component* owner, std::string name, std::string unit = {}, std::string doc = {})
        : OutputBase(owner, std::move(name), {std::move(unit), std::move(doc)}, typeInfo<T>(),
                     nullptr) {}
    /// An output whose values the executor checks for NaN and infinity before readers see them.
    Output(Component* owner, std::string name, std::string unit, Finite finite,
           std::string doc = {})
        : OutputBase(owner, std::move(name), {std::move(unit), std::move(doc)}, typeInfo<T>(),
                     &finite) {
        detail::requireCheckable<T>();
    }

    /// Writes a value and stamps it with the loop's time. Real-time safe if the assignment of T is;
    /// for messages of variable size, only up to the size given to reserve().
    void write(const T& value) noexcept(std::is_nothrow_copy_assignable_v<T>) {
        static_cast<Slot<T>*>(raw_)->value = value;
        stampWrite();
    }

    /// The value in place: change it, then call publish(). No reader sees a change before that. In
    /// one cycle, use either this or write(), which is faster for a small value. Real-time safe.
    T& value() noexcept RTCF_NONBLOCKING {
        if constexpr (kHasDraft) {
            // After write(), or a value that the executor has put back.
            if (draft().stamp != raw_->stamp) {
                copy(static_cast<const Slot<T>*>(raw_)->value, draft().value);
                draft().stamp = raw_->stamp;
            }
            return draft().value;
        } else {
            return static_cast<Slot<T>*>(raw_)->value;
        }
    }
    /// Writes the value changed in place. Real-time safe.
    void publish() noexcept RTCF_NONBLOCKING {
        if constexpr (kHasDraft) copy(value(), static_cast<Slot<T>*>(raw_)->value);
        stampWrite();
        if constexpr (kHasDraft) draft().stamp = raw_->stamp;
    }

    /// Reserves memory for values up to the size of `sample`, so that writing them does not
    /// allocate. In the constructor or in configure(); not real-time safe.
    void reserve(const T& sample) {
        static_cast<Slot<T>*>(raw_)->value = sample;
        SlotHeader* const seen = port().slot().get();
        static_cast<Slot<T>*>(seen)->value = sample;
        if constexpr (!PortType<T>::kFixedSize) port().setSample(typeInfo<T>().make_slot(seen));
    }

   private:
    static constexpr bool kMayThrow = !std::is_nothrow_copy_assignable_v<T>;
    // As isShared().
    static constexpr bool kHasDraft = PortType<T>::kFixedSize && sizeof(T) <= kLargestShared &&
                                      (!kMayThrow || std::is_trivially_destructible_v<T>);

    // A trivially destructible type owns no memory. Those of Eigen do not declare that their copies
    // throw nothing.
    static void copy(const T& from, T& to) noexcept RTCF_NONBLOCKING {
        if constexpr (kMayThrow) {
            std::memcpy(static_cast<void*>(&to), &from, sizeof(T));
        } else {
            to = from;
        }
    }

    Slot<T>& draft() const noexcept RTCF_NONBLOCKING {
        return static_cast<Slot<T>&>(port().draft());
    }
};

}  // namespace rtcf
