/// @file
/// What the frames of a loop hold: which outputs and states, in which order, and the ring itself.
/// Made by the graph thread for one plan and never changed; others read it, and give it back to
/// that thread, as it keeps component libraries loaded.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "frames/frame_ring.hpp"
#include "ordering/plan.hpp"
#include "watch/frame_column.hpp"
#include "watch/port_selection.hpp"

namespace rtcf::executor {

/// Selections by the number of the watch that made them.
using Watches = std::map<std::uint64_t, PortSelection>;

struct FrameTable {
    std::vector<FrameColumn> columns;  ///< in schedule order, as the ring's sources
    std::vector<std::string> notes;    ///< what is left out, a line each
    std::string shortness;             ///< if less than a second is kept: how much; else empty
    std::shared_ptr<FrameRing> ring;
    Watches watches;    ///< its readers
    bool kept = false;  ///< for them or an incident; else the last frame alone counts, for the loop
};

/// What is wanted of frames.
struct FrameDemand {
    const Watches& watches;
    double frequency_hz;  ///< of the loop; the ring holds about a second
    /// Of states and staged outputs in each cycle, watched or not; 0 = watched ones alone. The
    /// other outputs are always there: the loop puts them back after an update() that throws.
    std::size_t most_bytes;
    FrameMemory* memory;         ///< that outlives the process; may be null
    const FrameTable* previous;  ///< whose ring is kept if that copies the same; may be null
};

/// The most bytes of such values that a cycle copies, where those that are watched alone are
/// copied.
constexpr std::size_t kLargestFrame = std::size_t{64} * 1024;

/// Makes the table for a plan. What is watched comes first where there is not room for all.
std::shared_ptr<const FrameTable> makeFrameTable(const Plan& plan, const FrameDemand& demand);

/// Refuses a selection that has a pattern which matches nothing in the plan, and says what there
/// is.
void requireMatches(const PortSelection& selection, const Plan& plan);

}  // namespace rtcf::executor
