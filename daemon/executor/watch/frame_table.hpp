/// @file
/// The contents of a loop's frames: outputs and states in order, and the ring. Made by the graph
/// thread for one plan, and immutable. Other threads read it and return it to the graph thread,
/// which destroys it, because it keeps component libraries loaded.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "frames/frame_ring.hpp"
#include "loop/cycle_reader.hpp"
#include "ordering/plan.hpp"
#include "watch/component_turns.hpp"
#include "watch/frame_layout.hpp"
#include "watch/port_selection.hpp"

namespace rtcf::executor {

/// Values that a reader takes from each cycle.
struct Watch {
    PortSelection selection;  ///< outputs and states
    bool turns = false;       ///< also the end of each component's update()
};

/// Watches, by number.
using Watches = std::map<std::uint64_t, Watch>;

struct FrameTable {
    /// A tap that reads the frames.
    struct TapSource {
        std::shared_ptr<FrameTap> tap;
        std::size_t output;  ///< number among the ring's sources
    };
    std::vector<FrameColumn> columns;  ///< in schedule order, like the ring's first sources
    std::vector<std::string> notes;    ///< omitted values, one line each
    std::string shortness;             ///< message if less than one second is kept; else empty
    std::shared_ptr<FrameRing> ring;
    /// The components whose times are in the frames, in schedule order.
    std::vector<std::shared_ptr<ComponentStatistics>> components;
    ComponentTurns turns;  ///< empty unless a watch takes them
    Watches watches;       ///< watches that read the ring
    std::vector<TapSource> taps;
    /// Frames are kept for watches or an incident; else only for the loop and its statistics.
    bool kept = false;
};

/// Input of makeFrameTable().
struct FrameDemand {
    const Watches& watches;
    double frequency_hz;  ///< frequency of the loop; a ring that is kept holds about one second
    /// Most bytes of states and staged outputs per frame, watched or not; 0 = only watched ones.
    /// Other outputs are always in the frame: taps publish them, or the loop restores them after an
    /// update() that throws.
    std::size_t most_bytes;
    const CycleCounter& counter;  ///< counter of the loop
    FrameMemory* memory;          ///< memory that outlives the process; may be null
    /// Table whose ring is reused if sources and components are the same; may be null.
    const FrameTable* previous;
};

/// Most bytes of states and staged outputs per frame, if only watched ones are copied.
constexpr std::size_t kLargestFrame = std::size_t{64} * 1024;

/// Makes the table for a plan. If there is not room for all values, watched ones have priority.
std::shared_ptr<const FrameTable> makeFrameTable(const Plan& plan, const FrameDemand& demand);

/// Requires that each pattern of a selection matches something in the plan.
/// @throws Error that lists the available names
void requireMatches(const PortSelection& selection, const Plan& plan);

}  // namespace rtcf::executor
