/// @file
/// OROCOS' types of time.
#pragma once

#include <cstdint>

namespace RTT {

using Seconds = double;
using nsecs = std::int64_t;

}  // namespace RTT
