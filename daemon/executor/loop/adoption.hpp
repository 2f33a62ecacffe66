/// @file
/// The adoption: all changes that the loop makes at one cycle boundary. The graph thread builds it;
/// Cycle::apply() makes the changes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "frames/frame_ring.hpp"
#include "loop/schedule.hpp"
#include "rtcf/component.hpp"
#include "state/snapshot_work.hpp"
#include "state/state_copy.hpp"

namespace rtcf::executor {

/// A change of an input's source. Either `source` or `injector` is set; if neither is, the input
/// keeps its value and has no writer any more.
struct Rewire {
    InputPort* input;
    const SlotHeader* source;
    const Injector* injector;
    bool continued;  ///< the same writer's values as before
    bool arrived;    ///< the writer joins the loop: a queue gets the value of its start()
    /// Filled at the boundary: slot of the input's value before the change.
    const SlotHeader* held = nullptr;

    void apply() noexcept {
        QueueBase* const queue = input->queue();
        if (queue != nullptr) queue->receive();
        input->connectWritten();
        held = &input->slot();
        if (injector != nullptr) {
            input->connectOutside(injector->front(), &injector->fed());
        } else if (source != nullptr) {
            input->connect(source, continued);
        } else {
            input->disconnect();
            return;
        }
        if (queue == nullptr) return;
        if (continued) {
            // A loop break that has ended was a value behind.
            if (input->slot().stamp > input->seen()) queue->receive();
        } else if (!arrived) {
            queue->skip();
        }
    }
};

/// An input that may keep the value of an earlier writer until the new one writes.
struct Waiting {
    const Step* step;  ///< of the input's component
    InputPort* input;
};

/// A change of OutputPort::connected().
struct Audience {
    OutputPort* output;
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
    /// @name Taps of its outputs
    /// @{
    std::vector<SerializedTap*> serialized_taps;
    std::vector<FrameTap*> frame_taps;
    /// @}
    /// Filled at the boundary: ROS time of the last cycle; unset = the loop does not run.
    std::optional<std::int64_t> last_stamp_ns = std::nullopt;
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
    /// Ring that cycles fill from now on; null = no change. A new schedule requires one.
    FrameRing* frames = nullptr;
    /// Restores an earlier state before all other changes; if that fails, nothing else changes.
    Restoration* restoration = nullptr;
};

}  // namespace rtcf::executor
