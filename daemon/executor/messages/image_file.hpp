/// @file
/// File format of snapshots; defined in proto/rtcf/executor/v1/snapshot.proto. Pure functions.
#pragma once

#include <string>
#include <string_view>

#include "image/image.hpp"

namespace rtcf::executor {

/// @return the content of the file
std::string imageToFile(const RunnerImage& image);
/// @throws Refusal if the file is not a snapshot, has another format, or is damaged
RunnerImage imageFromFile(std::string_view file);

}  // namespace rtcf::executor
