/// @file
/// Matrices and vectors of linear systems in the cycle: of any size up to kMostStates, without
/// allocation.
#pragma once

#include <Eigen/Core>

#include <algorithm>
#include <cstdint>

#include "linear/matrix_text.hpp"

namespace rtcf_control {

using SmallMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMostStates, kMostStates>;
using SmallVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMostStates, 1>;

/// Bounds the work after missed cycles.
constexpr std::int64_t kMostSteps = 10;

/// Steps of a model from the last cycle to this one, at most kMostSteps. Real-time safe.
/// @param elapsed time since the last cycle, ns
/// @param period  of the model, ns
inline std::int64_t modelSteps(std::int64_t elapsed, std::int64_t period) noexcept {
    return std::clamp<std::int64_t>((elapsed + period / 2) / period, 1, kMostSteps);
}

}  // namespace rtcf_control
