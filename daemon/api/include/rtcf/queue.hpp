/// @file
/// An input that keeps every message, in order: for trajectories, joystick events, commands, of
/// which each one counts. An Input has the newest value alone.
///
///     rtcf::Queue<trajectory_msgs::JointTrajectory, 8> goals{this, "goals"};
///     …  while (const auto* goal = goals.front()) { begin(*goal); goals.pop(); }     // in
///     update()
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "rtcf/port.hpp"

namespace rtcf {

/// What the executor handles of any queue. Of an output a message is what it holds when its
/// component has run: one a cycle. Only whoever runs cycles touches it.
class QueueBase : public InputBase {
   public:
    /// Messages that are there. Real-time safe.
    std::size_t size() noexcept {
        receive();
        return ring_->count;
    }
    /// Removes the oldest message; without one nothing happens. Real-time safe.
    void pop() noexcept RTCF_NONBLOCKING {
        if (ring_->count == 0) return;
        ring_->oldest = (ring_->oldest + 1) % ring_->capacity;
        --ring_->count;
    }
    /// Loop time since the oldest message was written, ns; -1 without one. Real-time safe.
    std::int64_t age() noexcept;
    /// Messages that were lost: they came while there were as many as it keeps, or no memory.
    /// Real-time safe.
    std::uint64_t dropped() const noexcept RTCF_NONBLOCKING { return ring_->dropped; }
    /// As many as it keeps.
    std::size_t capacity() const noexcept RTCF_NONBLOCKING { return ring_->capacity; }

    /// @name For the executor; real-time safe as TypeInfo::copy is
    /// @{
    /// Takes the source's value if it is new. A value that finds no memory counts as dropped.
    void receive() noexcept {
        if (readStatus() != DataStatus::New) return;
        SlotHeader* const to = claim();
        if (to == nullptr) return;
        try {
            type().copy(*to, *current());
        } catch (...) {
            --ring_->count;
            ++ring_->dropped;
        }
    }
    /// A slot with the capacity that reserve() gave each message; null without it.
    const SlotHeader* sample() const noexcept { return ring_->sample.get(); }
    /// Takes a message out of `from`, which gets another value. @param time_ns of the loop
    void take(SlotHeader& from, std::int64_t time_ns) noexcept {
        SlotHeader* const to = claim();
        if (to == nullptr) return;
        type().exchange(*to, from);
        to->time_ns = time_ns;
    }
    /// What its source holds now is no message for it: a trajectory is not begun anew because its
    /// reader was loaded again.
    void skip() noexcept RTCF_NONBLOCKING {
        const SlotHeader* const source = reading().source;
        setReading({source, source, source->sequence, false});
    }
    /// So many were lost on their way here.
    void noteDropped(std::uint64_t count) noexcept RTCF_NONBLOCKING { ring_->dropped += count; }
    /// Forgets what is there; no drop.
    void clear() noexcept RTCF_NONBLOCKING { ring_->count = 0; }
    /// @}

   protected:
    // Apart from the component's own memory, which tells what it remembers, see State.
    struct Ring {
        std::size_t capacity;
        SlotHeader* (*at)(void* slots, std::size_t index);
        void* slots;
        std::size_t oldest = 0;
        std::size_t count = 0;
        std::uint64_t dropped = 0;
        std::shared_ptr<SlotHeader> sample = nullptr;
    };

    QueueBase(Component* owner, std::string name, const TypeInfo& type, const SlotHeader& empty,
              const Ring& ring)
        : InputBase(owner, std::move(name), type, empty), ring_(new Ring(ring)) {
        setQueue(this);
    }
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

    // The place of the next message; null, and counted, if there is none.
    SlotHeader* claim() noexcept {
        Ring& ring = *ring_;
        if (ring.count == ring.capacity) {
            ++ring.dropped;
            return nullptr;
        }
        return ring.at(ring.slots, (ring.oldest + ring.count++) % ring.capacity);
    }

    std::unique_ptr<Ring> ring_;
};

/// An input port that keeps up to N messages of type T.
template <typename T, std::size_t N>
class Queue final : public QueueBase {
    static_assert(N > 0, "a queue keeps one message at least");

   public:
    /// @param owner the component, `this`
    /// @param name  ROS base name, unique among the component's ports
    Queue(Component* owner, std::string name)
        : Queue(owner, std::move(name), std::make_unique<Slots>()) {}

    /// The oldest message, until pop(); null if there is none. Real-time safe.
    const T* front() noexcept {
        const SlotHeader* const slot = oldest();
        return slot == nullptr ? nullptr : &static_cast<const Slot<T>*>(slot)->value;
    }

    /// Takes the capacity of `sample`, so that messages of a component up to its size are kept
    /// without allocation; those of ROS allocate outside the cycle. For constructor and
    /// configure(); not real-time safe.
    void reserve(const T& sample) {
        for (Slot<T>& slot : *slots_) slot.value = sample;
        setSample(type().make_slot(&(*slots_)[0]));
    }

   private:
    using Slots = std::array<Slot<T>, N>;

    Queue(Component* owner, std::string name, std::unique_ptr<Slots> slots)
        : QueueBase(owner, std::move(name), typeInfo<T>(), (*slots)[0], {N, &at, slots.get()}),
          slots_(std::move(slots)) {}

    static SlotHeader* at(void* slots, std::size_t index) {
        return &(*static_cast<Slots*>(slots))[index];
    }

    std::unique_ptr<Slots> slots_;
};

}  // namespace rtcf
