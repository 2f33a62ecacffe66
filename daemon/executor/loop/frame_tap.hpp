/// @file
/// The tap of a type whose messages all have one size. Its values are in the loop's frames, so it
/// costs the cycle nothing: the reader's thread finds new values there by their stamps, and builds
/// the messages.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "exchange/tap.hpp"
#include "frames/frame_ring.hpp"
#include "statistics/counter.hpp"

namespace rtcf::executor {

class FrameTap final : public Tap {
   public:
    /// @param topic  mapped name of the connection
    /// @param type   type of the output, of fixed size
    /// @param source slot of the output; the tap keeps it alive
    FrameTap(std::string topic, const TypeInfo& type, std::shared_ptr<const SlotHeader> source);

    /// @name Graph thread
    /// @{
    /// Goes on with the frames of a ring, from FrameRing::base() on, after all frames so far. Does
    /// nothing if the tap follows this ring already.
    /// @param ring   the loop has begun to fill it
    /// @param output number of the output among the ring's sources
    void follow(std::shared_ptr<const FrameRing> ring, std::size_t output);
    /// Follows a move of the loop's time by `by` ns. Between two cycles.
    void moveTime(std::int64_t by);
    /// Adds the present value as the last one. The output's component has left the loop.
    /// @param stamp_ns ROS time of the value
    void finish(std::int64_t stamp_ns);
    /// @}

    bool pop(const Use& use) override;
    std::uint64_t dropped() const noexcept override { return dropped_.value(); }
    std::uint64_t tooLarge() const noexcept override { return 0; }
    /// Number of frames that the reader has yet to take; 0 without a reader. Any thread.
    std::uint64_t waiting() const;

   private:
    // Frames of a ring, up to the next part's first frame if that is in the same ring.
    struct Part {
        std::shared_ptr<const FrameRing> ring;
        std::size_t output;
        std::uint64_t first;    // frame
        std::int64_t moved_by;  // move of the stamps since the frames before, ns
    };
    // Old rings take memory from new ones, see FrameMemory. So a late reader keeps few of them, and
    // one that has taken nothing for kPatience, e.g. of a node that is disabled, keeps none.
    static constexpr std::size_t kMostParts = 7;
    static constexpr std::size_t kMostBytes = std::size_t{8} * 1024 * 1024;
    static constexpr std::chrono::seconds kPatience{10};

    void add(Part part);
    void enterNext();
    std::uint64_t endOf(std::size_t part) const;
    std::size_t bytesOfOldRings() const;
    void lose(std::uint64_t frames);
    bool findNext();
    bool isDue();
    bool build();

    std::mutex consumer_;                // held in pop(); protects the following
    std::shared_ptr<SlotHeader> value_;  // the last value read
    std::int64_t stamp_ns_ = 0;          // its ROS time
    // Values skipped since the last one taken; the first one is taken.
    std::uint32_t passed_over_ = UINT32_MAX - 1;
    std::vector<std::uint8_t> message_;
    Counter dropped_;

    mutable std::mutex mutex_;  // protects the following
    std::deque<Part> parts_;    // the first one is being read
    std::uint64_t next_ = 0;    // next frame of the first part
    std::uint64_t lost_ = 0;    // frames that were overwritten since the last one read
    std::int64_t last_stamp_ = 0;
    std::shared_ptr<SlotHeader> final_;  // of finish(); null = none
    std::int64_t final_stamp_ns_ = 0;
    std::chrono::steady_clock::time_point popped_at_;
    bool popped_ = false;
};

}  // namespace rtcf::executor
