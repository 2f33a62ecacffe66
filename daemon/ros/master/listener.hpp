/// @file
/// Who listens at an address: whether that is this machine, and whose process it is there.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <optional>
#include <string>

#include "ros/calls/master_client.hpp"

namespace rtcf::ros1 {

/// Whether a numeric address is one of this machine's. Not real-time.
bool isOfThisMachine(const std::string& address);

/// The user whose process listens on a port of this machine at this address; nothing if none does,
/// or it is not this machine's. Not real-time.
std::optional<uid_t> ownerOfListener(const MasterAddress& server);

}  // namespace rtcf::ros1
