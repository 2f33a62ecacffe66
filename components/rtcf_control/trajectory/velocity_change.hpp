/// @file
/// The fastest change of an axis's velocity.
#pragma once

#include "trajectory/motion.hpp"

namespace rtcf_control {

/// The fastest motion to a velocity without acceleration, under limits of acceleration and jerk:
/// a phase of full jerk to a peak acceleration, a phase of constant acceleration if the peak is the
/// largest one, and a phase of the opposite jerk. All functions are real-time safe.
class VelocityChange {
   public:
    /// @param begin  motion at the start; its acceleration is within the limits
    /// @param velocity velocity at the end, unit/s. Differences that rounding explains count as
    ///                 none.
    VelocityChange(const Motion& begin, double velocity, const MotionLimits& limits) noexcept
        RTCF_NONBLOCKING;

    [[nodiscard]] const PhaseList<3>& phases() const noexcept RTCF_NONBLOCKING { return phases_; }
    /// s
    [[nodiscard]] double duration() const noexcept RTCF_NONBLOCKING { return phases_.duration(); }
    /// Distance from start to end, unit.
    [[nodiscard]] double distance() const noexcept RTCF_NONBLOCKING { return distance_; }
    /// True if the velocity has to rise above the one that easing the acceleration leads to.
    [[nodiscard]] bool rises() const noexcept RTCF_NONBLOCKING { return change_ > 0.0; }
    /// True if it has to fall below that one.
    [[nodiscard]] bool falls() const noexcept RTCF_NONBLOCKING { return change_ < 0.0; }
    /// The velocity at the end minus the one that easing the acceleration leads to, unit/s.
    [[nodiscard]] double change() const noexcept RTCF_NONBLOCKING { return change_; }

   private:
    PhaseList<3> phases_;
    double change_ = 0.0;
    double distance_ = 0.0;
};

}  // namespace rtcf_control
