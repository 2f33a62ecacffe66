/// @file
/// The step of a command in time.
#pragma once

#include <algorithm>
#include <cstdint>

namespace rtcf_control {

/// Time by which a command moves on in a cycle, s: dt(), but at most ten periods. After a late
/// cycle, e.g. of a machine that was frozen, a command would jump otherwise. Real-time safe.
inline double boundedStep(double dt_s, std::int64_t period_ns) noexcept {
    return std::min(dt_s, 10e-9 * static_cast<double>(period_ns));
}

}  // namespace rtcf_control
