/// @file
/// File format of snapshots; defined in proto/rtcf/executor/v1/snapshot.proto. Pure functions.
#pragma once

#include <string>
#include <string_view>

#include "snapshot/snapshot.hpp"

namespace rtcf::executor {

/// @return the content of the file
std::string snapshotToFile(const Snapshot& snapshot);
/// @throws Error if the file is not a snapshot, has another format, or is damaged
Snapshot snapshotFromFile(std::string_view file);

}  // namespace rtcf::executor
