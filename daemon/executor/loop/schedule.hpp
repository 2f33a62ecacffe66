/// @file
/// What the real-time thread executes, and what it takes over at a cycle
/// boundary. Both are built by the graph thread; a schedule is never changed
/// once the loop has it.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "exchange/injector.hpp"
#include "exchange/tap.hpp"
#include "frames/frame_ring.hpp"
#include "loop/faults.hpp"
#include "rtcf/component.hpp"
#include "state/image_work.hpp"
#include "state/state_copy.hpp"
#include "statistics/histogram.hpp"

namespace rtcf::executor {

/// What the loop measures of one component. Outlives the schedules it is in.
struct ComponentFigures {
    Histogram duration;  ///< of update(), in ticks of the cycle counter
    std::atomic<std::uint64_t> overruns{
        0};  ///< cycles that passed the next deadline during its update
    DeviceFigures device;
    ComponentFaults faults;
};

/// One component's turn.
struct Step {
    Component* component;
    ComponentContext* context;
    ComponentFigures* figures;
    std::uint32_t slot;       ///< in the flight recorder
    std::uint32_t every = 1;  ///< runs in each n-th cycle,
    std::uint32_t phase = 0;  ///< in which the iteration modulo n is this
    bool optional = false;    ///< a fault takes it out, and the loop goes on
    /// When its last update() ended. Noted here by whoever runs the cycle, as this memory is at
    /// hand then.
    mutable std::int64_t ended_ticks = 0;
};

/// Steps that follow each other and are of one kind.
struct Stretch {
    const Step* begin;
    const Step* end;
    bool plain;  ///< they run every cycle, and their outputs are seen as they are written
};

/// A copy of an output's value, made before any component runs, for inputs that
/// are to see the previous cycle although their writer runs earlier.
struct Latch {
    const TypeInfo* type;
    SlotHeader* to;
    const SlotHeader* from;
    const Component* writer;

    /// Real-time safe as TypeInfo::copy is. @throws any exception of a copy
    void copy() const {
        if (to->sequence != from->sequence) type->copy(*to, *from);
    }
};

/// Values from outside the loop, and who reads them.
struct Feed {
    Injector* injector;
    std::vector<InputBase*> readers;
    std::vector<std::shared_ptr<Backlog>> backlogs;  ///< of the queues among them
};

/// The immutable list of a cycle's work. What it points to lives in the Plan that it is part of.
struct Schedule {
    std::uint64_t generation = 0;  ///< transactions adopted; the graph thread's
    std::vector<Feed> feeds;
    std::vector<Latch> latches;
    std::vector<QueueBase*> queues;  ///< that components of this loop feed
    std::vector<Step> steps;
    std::vector<Tap*> taps;
    Source* source = nullptr;  ///< paces the loop instead of the clock
    std::vector<Stretch> stretches;
    bool selective = false;              ///< some steps are not plain
    std::vector<const void*> footprint;  ///< cache lines to fetch before a cycle

    /// Once all steps are there.
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

/// An input that reads from another place. Either `source` or `injector` is
/// set; neither: the input keeps its value and has no writer any more.
struct Rewire {
    InputBase* input;
    const SlotHeader* source;
    const Injector* injector;
    bool continued;                    ///< the same writer's values as before
    const SlotHeader* kept = nullptr;  ///< filled at the boundary: where its present value stays

    void apply() noexcept {
        QueueBase* const queue = input->queue();
        if (queue != nullptr) queue->receive();
        if (source == nullptr && injector == nullptr) {
            input->disconnect();
        } else {
            input->rewire(injector != nullptr ? injector->front() : source, continued);
            if (queue != nullptr && !continued) queue->skip();
        }
        kept = queue != nullptr ? source : input->current();  // a queue's are copies
    }
};

/// An output that learns whether anybody gets its values.
struct Audience {
    OutputBase* output;
    bool present;
};

/// One component handing its state to its successor.
struct HandOver {
    Component* successor;
    const Component* previous;
    std::vector<StateCopy> states;
    /// Filled at the boundary: what was taken out after a fault hands over nothing.
    bool skipped = false;
};

/// A component whose last cycle has come while the loop runs.
struct Leaving {
    Component* component;
    ComponentFigures* figures;
    std::vector<Latch> latches;  ///< of its outputs, by which others see the previous cycle
    std::vector<Tap*> taps;      ///< of its outputs
};

/// Everything that changes at one cycle boundary. Owned by the graph thread,
/// which waits until Cycle::apply() has made the change.
struct Adoption {
    const Schedule* schedule = nullptr;  ///< the next one; null = stays
    std::vector<Latch> new_latches;      ///< to be filled before inputs read them
    std::vector<Rewire> rewires;
    std::size_t rewires_of_new = 0;  ///< the first so many are of inputs that never had a writer
    std::vector<Audience> audiences;
    std::vector<HandOver> hand_overs;
    std::vector<StateCopy> copies;  ///< of state, e.g. to be looked at
    std::vector<Leaving> leaving;
    std::vector<StagedValue*> values;  ///< parameters, and what derives from them
    std::int64_t period_ns = 0;        ///< the loop's new period; 0 = stays
    FrameRing* frames = nullptr;       ///< that cycles fill from now on; null = stays
    /// Of an earlier state, before anything else; if that refuses, nothing else is done either.
    Restoration* restoration = nullptr;
};

}  // namespace rtcf::executor
