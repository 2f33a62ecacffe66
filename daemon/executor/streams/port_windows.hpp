/// @file
/// The window of cycles that is open in a stream of minima and maxima. Main thread only.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "frames/frame_ring.hpp"
#include "rtcf/v1/ports.pb.h"
#include "streams/port_packer.hpp"
#include "watch/extremes.hpp"

namespace rtcf::executor {

class PortWindows {
   public:
    /// @param columns of the table that are told
    /// @param every   cycles of a window; it begins with a multiple of that
    PortWindows(const FrameTable& table, const std::vector<std::size_t>& columns,
                std::uint32_t every);

    /// Cycles in the open window.
    std::uint32_t count() const noexcept { return count_; }
    /// Number of its first cycle, whether that has come or not.
    std::uint64_t first() const noexcept { return first_; }
    /// Whether it can be told: its last cycle has come, or end() was called.
    bool whole() const noexcept { return whole_; }
    /// Nothing more will come into it.
    void end() noexcept { whole_ = count_ != 0; }
    /// Whether a cycle belongs into it.
    bool takes(const Frame& frame) const noexcept;
    /// @param packers of its columns
    void add(const Frame& frame, const std::vector<PortPacker>& packers);
    /// Appends it to a batch, and opens the next one. @return bytes, about
    std::size_t close(::rtcf::v1::PortBatch& batch);

   private:
    std::vector<Extremes> extremes_;  // by column
    std::uint32_t every_;
    std::size_t bytes_ = 64;
    std::string value_;
    std::uint64_t first_ = 0;
    std::uint64_t earliest_ = 0;  // first and last cycle added so far
    std::uint64_t latest_ = 0;
    std::uint32_t count_ = 0;
    bool whole_ = false;
    bool last_of_loop_ = false;
    std::int64_t stamp_ns_ = 0;
    std::int64_t latency_ns_ = 0;
    std::int64_t duration_ns_ = 0;
};

}  // namespace rtcf::executor
