/// @file
/// Owner of a listening socket on this machine.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <optional>
#include <string>

#include "ros/calls/master_client.hpp"

namespace rtcf::ros1 {

/// True if a numeric address belongs to this machine. Not real-time.
bool isOfThisMachine(const std::string& address);

/// The user whose process listens at this address of this machine; nothing if there is none, or if
/// the address is not of this machine. Not real-time.
std::optional<uid_t> ownerOfListener(const MasterAddress& server);

}  // namespace rtcf::ros1
