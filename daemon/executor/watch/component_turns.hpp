/// @file
/// When each component's update() ended, in each cycle: what frames hold of it, and how it travels.
/// The cycle measures it whoever looks, in the steps of the schedule; frames that somebody watches
/// copy it from there. Made by the graph thread, never changed.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "frames/frame_ring.hpp"
#include "loop/cycle.hpp"
#include "loop/schedule.hpp"

namespace rtcf::executor {

class ComponentTurns {
   public:
    /// Nobody wants them.
    ComponentTurns() = default;
    /// @param first of the sources that appendSources() has given the ring
    ComponentTurns(const Schedule& schedule, const CycleCounter& counter, const FrameRing& ring,
                   std::size_t first);

    /// Appends what frames are to copy.
    static void appendSources(const Schedule& schedule, const Cycle& cycle,
                              std::vector<FrameRing::Source>& sources);

    bool wanted() const noexcept { return !offsets_.empty(); }
    /// Full names, in the order of the schedule.
    const std::vector<std::string>& components() const noexcept { return components_; }
    /// Bytes that pack() appends.
    std::size_t length() const noexcept { return 8 * (1 + components_.size()); }
    /// Appends, as int64 in ns from the beginning of the frame's cycle, when the first component's
    /// turn began and when each one's update() ended; -1 = it did not run.
    void pack(const Frame& frame, std::string& to) const;

   private:
    std::vector<std::string> components_;
    std::vector<std::size_t>
        offsets_;  // in a frame, bytes: of the cycle's marks, then by component
    CycleCounter counter_;
};

}  // namespace rtcf::executor
