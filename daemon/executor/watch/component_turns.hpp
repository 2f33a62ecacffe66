/// @file
/// The times at which each component's update() ended in a cycle: their place in frames, and their
/// form in messages. The cycle always measures them, in the steps of the schedule; only watched
/// frames copy them. Made by the graph thread; immutable.
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
    /// No times, because no watch requests them.
    ComponentTurns() = default;
    /// @param first index of the first source of the ring that appendSources() has added
    ComponentTurns(const Schedule& schedule, const CycleCounter& counter, const FrameRing& ring,
                   std::size_t first);

    /// Appends the sources that frames copy.
    static void appendSources(const Schedule& schedule, const Cycle& cycle,
                              std::vector<FrameRing::Source>& sources);

    bool wanted() const noexcept { return !offsets_.empty(); }
    /// Full names, in the order of the schedule.
    const std::vector<std::string>& components() const noexcept { return components_; }
    /// Number of bytes that pack() appends.
    std::size_t length() const noexcept { return 8 * (1 + components_.size()); }
    /// Appends the begin of the first component and the end of each update(), as int64, ns since
    /// the begin of the frame's cycle; -1 = it did not run.
    void pack(const Frame& frame, std::string& to) const;

   private:
    std::vector<std::string> components_;
    std::vector<std::size_t>
        offsets_;  // offsets in a frame, bytes: the cycle's marks, then one per component
    CycleCounter counter_;
};

}  // namespace rtcf::executor
