/// @file
/// The schedule, which the real-time thread executes, and the adoption, which it applies at a cycle
/// boundary. The graph thread builds both. A schedule does not change once the loop has it.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "exchange/injector.hpp"
#include "exchange/tap.hpp"
#include "frames/frame_ring.hpp"
#include "loop/faults.hpp"
#include "rtcf/component.hpp"
#include "state/snapshot_work.hpp"
#include "state/state_copy.hpp"
#include "statistics/histogram.hpp"

namespace rtcf::executor {

/// Statistics of one component. Outlives the schedules that contain the component.
struct ComponentStatistics {
    Histogram duration;  ///< of update(), in ticks of the cycle counter
    /// Cycles whose next deadline passed during this component's update().
    std::atomic<std::uint64_t> overruns{0};
    DeviceStatistics device;
    ComponentFaults faults;
};

/// One component's turn.
struct Step {
    Component* component;
    ComponentContext* context;
    ComponentStatistics* statistics;
    std::uint32_t slot;       ///< in the flight recorder
    std::uint32_t every = 1;  ///< runs in every n-th cycle,
    std::uint32_t phase = 0;  ///< when the iteration modulo n equals this
    bool optional = false;    ///< a fault takes the component out, and the loop goes on
    /// End of the last update(), ticks. The cycle thread writes it here because this cache line is
    /// already loaded.
    mutable std::int64_t ended_ticks = 0;
};

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
    std::vector<Tap*> taps;
    Source* source = nullptr;  ///< component that paces the loop; null = the clock does
    std::vector<Stretch> stretches;
    bool selective = false;              ///< true = some steps are not plain
    std::vector<const void*> footprint;  ///< cache lines to fetch before a cycle

    /// Groups the steps. After all steps are added.
    void findStretches() {
        for (const Step& step : steps) {
            const bool plain =
                step.every == 1 && !step.optional && step.component->stagedOutputs().empty();
            selective = selective || !plain;
            if (stretches.empty() || stretches.back().plain != plain)
                stretches.push_back({&step, &step, plain});
            ++stretches.back().end;
        }
    }
};

/// A change of an input's source. Either `source` or `injector` is set; if neither is, the input
/// keeps its value and has no writer any more.
struct Rewire {
    InputPort* input;
    const SlotHeader* source;
    const Injector* injector;
    bool continued;  ///< the same writer's values as before
    /// Filled at the boundary: slot of the input's value before the change.
    const SlotHeader* held = nullptr;

    void apply() noexcept {
        QueueBase* const queue = input->queue();
        if (queue != nullptr) queue->receive();
        input->connectWritten();
        held = &input->slot();
        if (injector != nullptr) {
            input->connectOutside(injector->front());
        } else if (source != nullptr) {
            input->connect(source, continued);
        } else {
            input->disconnect();
            return;
        }
        if (queue != nullptr && !continued) queue->skip();
    }
};

/// An input that may keep the value of an earlier writer until the new one writes.
struct Waiting {
    const Step* step;  ///< of the input's component
    InputPort* input;
};

/// A change of OutputBase::connected().
struct Audience {
    OutputBase* output;
    bool present;
};

/// Hand-over of state from a component to its successor.
struct HandOver {
    Component* successor;
    const Component* previous;
    std::vector<StateCopy> states;
    /// Filled at the boundary: a component that was taken out after a fault hands over nothing.
    bool skipped = false;
};

/// A component that leaves the running loop: its last cycle is at the boundary.
struct Leaving {
    Component* component;
    ComponentStatistics* statistics;
    std::vector<Latch> latches;  ///< latches of its outputs
    std::vector<Tap*> taps;      ///< taps of its outputs
};

/// All changes of one cycle boundary. Owned by the graph thread, which waits until Cycle::apply()
/// has made them.
struct Adoption {
    const Schedule* schedule = nullptr;  ///< the next schedule; null = no change
    std::vector<Latch> new_latches;      ///< latches to fill before inputs read them
    std::vector<Rewire> rewires;
    std::size_t rewires_of_new = 0;  ///< the first rewires, for inputs that never had a writer
    /// Inputs of the schedule that may wait after the rewires and the restoration, in its order.
    std::vector<Waiting> waiting;
    std::vector<Audience> audiences;
    std::vector<HandOver> hand_overs;
    std::vector<StateCopy> copies;  ///< copies of state, e.g. to show it
    std::vector<Leaving> leaving;
    std::vector<StagedValue*> values;  ///< parameters and derived values
    std::int64_t period_ns = 0;        ///< the loop's new period, ns; 0 = no change
    FrameRing* frames = nullptr;       ///< ring that cycles fill from now on; null = no change
    bool timed = false;                ///< the ring's frames have the components' times
    /// Restores an earlier state before all other changes; if that fails, nothing else changes.
    Restoration* restoration = nullptr;
};

}  // namespace rtcf::executor
