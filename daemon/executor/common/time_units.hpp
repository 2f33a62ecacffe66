/// @file
/// Time units, ns.
#pragma once

#include <cstdint>

namespace rtcf::executor {

inline constexpr std::int64_t kSecond = 1'000'000'000;

}  // namespace rtcf::executor
