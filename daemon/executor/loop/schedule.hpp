/// @file
/// The schedule, which the real-time thread executes. The graph thread builds it. It does not
/// change once the loop has it.
#pragma once

#include <atomic>
#include <cstdint>
#include <cstring>
#include <memory>
#include <vector>

#include "exchange/injector.hpp"
#include "exchange/serialized_tap.hpp"
#include "loop/faults.hpp"
#include "loop/frame_tap.hpp"
#include "rtcf/component.hpp"
#include "statistics/counter.hpp"
#include "statistics/histogram.hpp"

namespace rtcf::executor {

/// Statistics of one component. Outlives the schedules that contain the component.
struct ComponentStatistics {
    Histogram duration;  ///< of update(), in ticks of the cycle counter; see CycleStatistics
    /// Cycles whose next deadline passed during this component's update().
    EventCounter overruns;
    DeviceStatistics device;
    DeviceStatistics device_before;  ///< `device` at the last restart()
    ComponentFaults faults;

    /// Resets the statistics but `overruns`. Only by CycleStatistics.
    void restart() noexcept {
        duration.clear();
        device_before.calls.store(device.calls.load(std::memory_order_relaxed));
        device_before.time_ns.store(device.time_ns.load(std::memory_order_relaxed));
    }
};

/// One component's turn: what each cycle uses of it.
struct Step {
    Component* component;
    void (*update)(Component*);  ///< updateOf() the component
    std::uint32_t slot;          ///< in the flight recorder
    std::uint32_t every;         ///< runs in every n-th cycle
};

/// The rest of a turn.
struct Turn {
    ComponentStatistics* statistics;
    std::uint32_t phase;  ///< runs when the iteration modulo `every` equals this
    bool optional;        ///< a fault takes the component out, and the loop goes on
};

/// The function that a call of a component's update() runs, so that a cycle need not look it up.
inline auto updateOf(const Component& component) noexcept {
    void (Component::* const update)() = &Component::update;
    std::uintptr_t offset = 0;
    std::memcpy(&offset, &update, sizeof offset);
#if !defined(__aarch64__) && !defined(__arm__)
    offset -= 1;  // Itanium C++ ABI, 2.3: plus 1 for virtual functions, which ARM notes elsewhere
#endif
    const char* table = nullptr;
    std::memcpy(static_cast<void*>(&table), reinterpret_cast<const char*>(&component),
                sizeof table);
    void (*function)(Component*) = nullptr;
    std::memcpy(static_cast<void*>(&function), table + offset, sizeof function);
    return function;
}

/// Consecutive steps of one kind.
struct Stretch {
    const Step* begin;
    const Step* end;
    bool plain;  ///< the steps run every cycle and have no staged outputs
};

/// A copy of an output's value, made before any component runs, for inputs that read the previous
/// cycle's value although their writer runs earlier.
struct Latch {
    const TypeInfo* type;
    SlotHeader* to;
    const SlotHeader* from;
    const Component* writer;

    /// Real-time safe if TypeInfo::copy is. @throws any exception of a copy
    void copy() const {
        if (to->stamp != from->stamp) type->copy(*to, *from);
    }
};

/// Values from outside the loop, and their readers.
struct Feed {
    Injector* injector;
    std::vector<InputPort*> readers;
    std::vector<std::shared_ptr<Backlog>> backlogs;  ///< backlogs of the queues among the readers
};

/// The immutable list of a cycle's work. The Plan that contains it owns the objects it points to.
struct Schedule {
    std::uint64_t generation = 0;  ///< transactions adopted so far; for the graph thread
    std::vector<Feed> feeds;
    std::vector<Latch> latches;
    std::vector<QueueBase*> queues;  ///< queues fed by components of this loop
    std::vector<Step> steps;
    std::vector<Turn> turns;  ///< of the steps
    std::vector<SerializedTap*> serialized_taps;
    std::vector<FrameTap*> frame_taps;
    Source* source = nullptr;  ///< component that paces the loop; null = the clock does
    std::vector<Stretch> stretches;
    bool selective = false;              ///< true = some steps are not plain
    std::vector<const void*> footprint;  ///< cache lines to fetch before a cycle

    const Turn& turnOf(const Step& step) const noexcept {
        return turns[static_cast<std::size_t>(&step - steps.data())];
    }

    /// Groups the steps. After all steps and turns are added.
    void findStretches() {
        for (const Step& step : steps) {
            const bool plain = step.every == 1 && !turnOf(step).optional &&
                               accessTo(*step.component).stagedOutputs().empty();
            selective = selective || !plain;
            if (stretches.empty() || stretches.back().plain != plain)
                stretches.push_back({&step, &step, plain});
            ++stretches.back().end;
        }
    }
};

}  // namespace rtcf::executor
