/// @file
/// An input that keeps every message, in order: for trajectories, joystick events and commands.
/// An Input keeps only the newest value.
///
///     rtcf::Queue<trajectory_msgs::JointTrajectory, 8> goals{this, "goals"};
///
///     for (; const auto* goal = goals.front(); goals.pop()) begin(*goal);  // in update()
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "rtcf/port.hpp"

namespace rtcf {

/// Base class of queues of all types. If an output feeds the queue, the queue gets one message per
/// cycle: the output's value after its component has run. Only the cycle thread uses it.
class QueueBase : public InputBase {
   public:
    /// Number of messages in the queue. Real-time safe if the assignment of T is.
    std::size_t size() noexcept {
        receive();
        return ring_->count;
    }
    /// Removes the oldest message; does nothing if the queue is empty. Real-time safe.
    void pop() noexcept RTCF_NONBLOCKING {
        if (ring_->count == 0) return;
        ring_->oldest = (ring_->oldest + 1) % ring_->capacity;
        --ring_->count;
    }
    /// Removes all messages, without counting drops. Real-time safe.
    void clear() noexcept RTCF_NONBLOCKING { ring_->count = 0; }
    /// Loop time since the oldest message was written, ns; -1 if the queue is empty. Real-time safe
    /// if the assignment of T is.
    std::int64_t age() noexcept;
    /// True if an output or a ROS topic feeds this queue. Real-time safe.
    bool connected() const noexcept RTCF_NONBLOCKING { return ring_->port->connected(); }
    /// Number of messages lost so far, because the queue was full or memory ran out. Real-time
    /// safe.
    std::uint64_t dropped() const noexcept RTCF_NONBLOCKING { return ring_->dropped; }
    /// Most messages that the queue keeps. Real-time safe.
    std::size_t capacity() const noexcept RTCF_NONBLOCKING { return ring_->capacity; }

    /// @name For the executor; real-time safe if TypeInfo::copy is
    /// @{
    /// Description of the messages' type.
    const TypeInfo& type() const noexcept { return ring_->port->type(); }
    /// Appends the source's value if it is new. If memory runs out, the message counts as dropped.
    void receive() noexcept {
        if (readStatus() != DataStatus::New) return;
        SlotHeader* const to = claim();
        if (to == nullptr) return;
        try {
            type().copy(*to, slot());
        } catch (...) {
            --ring_->count;
            ++ring_->dropped;
        }
    }
    /// A slot with the capacity set by reserve(); null without it.
    const SlotHeader* sample() const noexcept { return ring_->sample.get(); }
    /// Appends the value of `from` by swapping; `from` then has an unspecified value.
    /// @param time_ns loop time of the message, ns
    void take(SlotHeader& from, std::int64_t time_ns) noexcept {
        SlotHeader* const to = claim();
        if (to == nullptr) return;
        type().exchange(*to, from);
        to->stamp = stampOf(time_ns);
    }
    /// Ignores the present value of the source, so that a reloaded component does not get an old
    /// trajectory again.
    void skip() noexcept RTCF_NONBLOCKING { skipValue(); }
    /// Follows a move of the loop's time by `by` ns: the messages keep their ages.
    void moveTime(std::int64_t by) noexcept {
        Ring& ring = *ring_;
        for (std::size_t i = 0; i < ring.count; ++i) {
            SlotHeader& slot = *ring.at(ring.slots, (ring.oldest + i) % ring.capacity);
            slot.stamp = movedStamp(slot.stamp, by);
        }
    }
    /// Counts messages that were lost before they reached the queue.
    void noteDropped(std::uint64_t count) noexcept RTCF_NONBLOCKING { ring_->dropped += count; }
    /// @}

   protected:
    // Kept outside the component's object: `rtcfctl check` compares the object's bytes to find
    // undeclared state.
    struct Ring {
        std::size_t capacity;
        SlotHeader* (*at)(void* slots, std::size_t index);
        void* slots;
        std::size_t oldest = 0;
        std::size_t count = 0;
        std::uint64_t dropped = 0;
        std::shared_ptr<SlotHeader> sample = nullptr;
        InputPort* port = nullptr;
    };

    QueueBase(Component* owner, std::string name, const TypeInfo& type, const Ring& ring,
              PortTexts texts = {});
    ~QueueBase() = default;

    void setSample(std::shared_ptr<SlotHeader> sample) noexcept {
        ring_->sample = std::move(sample);
    }

    const SlotHeader* oldest() noexcept {
        receive();
        return ring_->count == 0 ? nullptr : ring_->at(ring_->slots, ring_->oldest);
    }

   private:
    friend struct AbiProbe;

    // The slot for the next message. If the queue is full, counts a drop and returns null.
    SlotHeader* claim() noexcept {
        Ring& ring = *ring_;
        if (ring.count == ring.capacity) {
            ++ring.dropped;
            return nullptr;
        }
        return ring.at(ring.slots, (ring.oldest + ring.count++) % ring.capacity);
    }

    static inline const SlotHeader kNoValue{};  // read without a writer

    std::unique_ptr<Ring> ring_;
};

/// An input port that keeps up to N messages of type T.
template <typename T, std::size_t N>
class Queue final : public QueueBase {
    static_assert(N > 0, "a queue keeps one message at least");

   public:
    /// @param owner the component, `this`
    /// @param name  ROS base name, unique among the component's ports
    /// @param unit  unit of a message, for people
    /// @param doc   what a message is, one line, for people
    Queue(Component* owner, std::string name, std::string unit = {}, std::string doc = {})
        : Queue(owner, std::move(name), std::make_unique<Slots>(),
                {std::move(unit), std::move(doc)}) {}

    /// The oldest message; null if the queue is empty. The pointer is valid until pop(). Real-time
    /// safe if the assignment of T is.
    const T* front() noexcept {
        const SlotHeader* const slot = oldest();
        return slot == nullptr ? nullptr : &static_cast<const Slot<T>*>(slot)->value;
    }

    /// Reserves memory for messages up to the size of `sample`, so that messages from an output are
    /// kept without allocation. (Messages from ROS are allocated outside the cycle.) In the
    /// constructor or in configure(); not real-time safe.
    void reserve(const T& sample) {
        for (Slot<T>& slot : *slots_) slot.value = sample;
        setSample(type().make_slot(&(*slots_)[0]));
    }

   private:
    // The executor calls these by QueueBase.
    using QueueBase::moveTime;
    using QueueBase::noteDropped;
    using QueueBase::receive;
    using QueueBase::sample;
    using QueueBase::skip;
    using QueueBase::take;
    using QueueBase::type;

    using Slots = std::array<Slot<T>, N>;

    Queue(Component* owner, std::string name, std::unique_ptr<Slots> slots, PortTexts texts)
        : QueueBase(owner, std::move(name), typeInfo<T>(), {N, &at, slots.get()}, std::move(texts)),
          slots_(std::move(slots)) {}

    static SlotHeader* at(void* slots, std::size_t index) {
        return &(*static_cast<Slots*>(slots))[index];
    }

    std::unique_ptr<Slots> slots_;
};

}  // namespace rtcf
