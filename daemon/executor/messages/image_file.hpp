/// @file
/// An image of a runner as a file has it; proto/rtcf/executor/v1/snapshot.proto says how. Pure
/// functions.
#pragma once

#include <string>
#include <string_view>

#include "image/image.hpp"

namespace rtcf::executor {

/// @return a whole file
std::string imageToFile(const RunnerImage& image);
/// @throws Refusal if it is no snapshot, of another format, or not as it was written
RunnerImage imageFromFile(std::string_view file);

}  // namespace rtcf::executor
