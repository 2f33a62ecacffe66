/// @file
/// What the values of frames mean, for who reads them when this process is gone: a FrameLayout of
/// executor.proto. Graph thread.
#pragma once

#include <string>

#include "watch/frame_table.hpp"

namespace rtcf::executor {

/// @return the layout of a table's ring, serialised
std::string frameLayout(const FrameTable& table);

}  // namespace rtcf::executor
