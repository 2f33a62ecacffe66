/// @file
/// The times at which each component's update() ended in a cycle, as messages. Made by the graph
/// thread for a watch; immutable.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "frames/frame_ring.hpp"
#include "loop/schedule.hpp"
#include "realtime/cycle_counter.hpp"

namespace rtcf::executor {

class ComponentTurns {
   public:
    /// No times, because no watch requests them.
    ComponentTurns() = default;
    /// @param counter of the frames' ticks
    ComponentTurns(const Schedule& schedule, const CycleCounter& counter);

    /// Full names, in the order of the schedule.
    const std::vector<std::string>& components() const noexcept { return components_; }
    /// Number of bytes that pack() appends.
    std::size_t length() const noexcept { return 8 * (1 + components_.size()); }
    /// Appends the begin of the first component and the end of each update(), as int64, ns since
    /// the begin of the frame's cycle; -1 = it did not run.
    void pack(const Frame& frame, std::string& to) const;

   private:
    std::vector<std::string> components_;
    CycleCounter counter_;
};

}  // namespace rtcf::executor
