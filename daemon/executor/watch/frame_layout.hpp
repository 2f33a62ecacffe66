/// @file
/// Layout of the values in frames, for reading them after the end of this process: a FrameLayout of
/// executor.proto. Graph thread.
#pragma once

#include <string>
#include <vector>

#include "frames/frame_ring.hpp"
#include "watch/frame_column.hpp"

namespace rtcf::executor {

/// Serialises the layout of a ring.
/// @param columns its sources, in order
/// @param notes   omitted values, one line each
std::string frameLayout(const FrameRing& ring, const std::vector<FrameColumn>& columns,
                        const std::vector<std::string>& notes);

}  // namespace rtcf::executor
