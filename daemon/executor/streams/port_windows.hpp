/// @file
/// The open window of a stream of minima and maxima: consecutive cycles whose extreme values become
/// the next row of the stream. Main thread only.
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
    /// @param columns indices of the table's columns in the stream
    /// @param every   length of a window, cycles; the number of its first cycle is a multiple of it
    PortWindows(const FrameTable& table, const std::vector<std::size_t>& columns,
                std::uint32_t every);

    /// Number of cycles added to the open window.
    std::uint32_t count() const noexcept { return count_; }
    /// Number of the window's first cycle, which may be missing in the window.
    std::uint64_t first() const noexcept { return first_; }
    /// True if the window is complete: its last cycle was added, or end() was called.
    bool whole() const noexcept { return whole_; }
    /// Completes the window if it has any cycle.
    void end() noexcept { whole_ = count_ != 0; }
    /// True if a cycle belongs to the open window.
    bool takes(const Frame& frame) const noexcept;
    /// Adds a cycle to the window.
    /// @param packers one per column
    void add(const Frame& frame, const std::vector<PortPacker>& packers);
    /// Appends the window to a batch, and opens the next one.
    /// @return approximate size of the window in the batch, bytes
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
