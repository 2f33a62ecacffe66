/// @file
/// The step of a command in time.
#pragma once

#include <algorithm>
#include <cstdint>

namespace rtcf_control {

/// Periods by which a command moves on in a cycle at most. After a late cycle, e.g. of a machine
/// that was frozen, a command would jump otherwise.
constexpr std::int64_t kLongestStep = 10;

/// Time by which a command moves on in a cycle, s: dt(), but at most kLongestStep periods.
/// Real-time safe.
inline double boundedStep(double dt_s, std::int64_t period_ns) noexcept {
    return std::min(dt_s, 1e-9 * kLongestStep * static_cast<double>(period_ns));
}

}  // namespace rtcf_control
