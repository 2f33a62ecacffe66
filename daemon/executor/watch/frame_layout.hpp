/// @file
/// What the values of frames mean, for who reads them when this process is gone: a FrameLayout of
/// executor.proto. Graph thread.
#pragma once

#include <string>
#include <vector>

#include "frames/frame_ring.hpp"
#include "watch/frame_column.hpp"

namespace rtcf::executor {

/// @return the layout of a ring, serialised
/// @param columns its sources, in their order
/// @param notes   what is left out, a line each
std::string frameLayout(const FrameRing& ring, const std::vector<FrameColumn>& columns,
                        const std::vector<std::string>& notes);

}  // namespace rtcf::executor
