#include "trajectory/velocity_change.hpp"

#include <algorithm>
#include <cmath>

namespace rtcf_control {

namespace {

// Rounding errors of a velocity that was sampled from a motion, relative to the largest velocities.
// A larger change would cost time in proportion to its square root.
constexpr double kVelocityTolerance = 1e-12;

}  // namespace

VelocityChange::VelocityChange(const Motion& begin, double velocity,
                               const MotionLimits& limits) noexcept RTCF_NONBLOCKING {
    const double jerk = limits.jerk;
    const double eased = begin.easedVelocity(jerk);
    change_ = velocity - eased;
    const double scale =
        std::max({limits.velocity, std::abs(begin.velocity), std::abs(velocity), std::abs(eased)});
    if (std::abs(change_) <= kVelocityTolerance * scale) change_ = 0.0;

    const double sign =
        change_ == 0.0 ? std::copysign(1.0, begin.acceleration) : std::copysign(1.0, change_);
    const double own = sign * begin.acceleration;
    const double square = jerk * std::abs(change_) + (own > 0.0 ? own * own : 0.0);
    double peak = std::sqrt(square);
    double hold = 0.0;
    if (peak > limits.acceleration) {
        peak = std::max(limits.acceleration, own);
        hold = (square - peak * peak) / (peak * jerk);
    }
    phases_.add({(peak - own) / jerk, sign * jerk, sign * peak});
    phases_.add({hold, 0.0, sign * peak});
    phases_.add({peak / jerk, -sign * jerk, 0.0});
    distance_ = phases_.motionAfter({0.0, begin.velocity, begin.acceleration}).position;
}

}  // namespace rtcf_control
