/// @file
/// A reader of a loop's cycles, one after another, across changes of its graph. The ring of each
/// graph is read to its end before that of the next one.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <vector>

#include "frames/frame_ring.hpp"
#include "loop/schedule.hpp"

namespace rtcf::executor {

/// The ring of a graph's cycles, and the components that note their end in its frames.
struct CycleFrames {
    std::shared_ptr<FrameRing> ring;
    std::vector<std::shared_ptr<ComponentStatistics>> components;  ///< in schedule order
};

/// One thread at a time.
class CycleReader {
   public:
    static constexpr std::size_t kMostRings = 8;  ///< rings that the reader may be behind

    /// Adds the next ring. After the loop has begun to fill it.
    void follow(const CycleFrames& frames);
    /// Reads the next cycle, without its values.
    /// @return the frames it belongs to; null = there is none yet
    const CycleFrames* next(Frame& frame);
    /// Number of cycles of the present ring, or of an earlier one, that are not read yet.
    std::uint64_t waiting() const noexcept {
        return rings_.empty() ? 0 : rings_.front().ring->end() - next_;
    }
    /// Passes over all cycles so far.
    void skip();
    /// Cycles that were overwritten before they were read.
    std::uint64_t lost() const noexcept { return lost_; }
    /// The frames of the present graph; null before the first.
    const CycleFrames* present() const noexcept {
        return rings_.empty() ? nullptr : &rings_.back();
    }

   private:
    void leaveRing();

    std::deque<CycleFrames> rings_;  // the first one is being read
    std::uint64_t next_ = 0;         // next frame of the first ring
    std::uint64_t lost_ = 0;
};

}  // namespace rtcf::executor
