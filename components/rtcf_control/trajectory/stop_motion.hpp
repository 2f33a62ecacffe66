/// @file
/// The fastest stop of one axis.
#pragma once

#include "trajectory/motion.hpp"

namespace rtcf_control {

/// The motion of one axis from any state to rest, as fast as possible, under limits of position,
/// velocity, acceleration and jerk. Where they do not all hold, they give way in this order:
///
/// 1. Jerk, which limits vibration only. An acceleration that is beyond its limit, or from which
/// the
///    velocity would exceed its limit, drops at once to the largest one that is allowed. If the
///    stop would leave the limits of position, the jerk rises fourfold, up to 4^8 of its limit.
/// 2. Acceleration, which a drive may exceed for a short time. If all that is not enough, the axis
///    brakes with the constant deceleration that ends at the limit of position.
///
/// Velocity and position never give way: a velocity beyond its limit does not grow, and an axis
/// that is already beyond a limit of position, and moves away, brakes at once with the largest
/// acceleration.
///
/// From a state in which all limits can hold, the motion has the shortest way of all stops: it
/// never passes the target of a motion within the same limits that ends at rest. All functions are
/// real-time safe, with a bounded number of steps.
class StopMotion {
   public:
    /// At rest at position 0.
    StopMotion() = default;
    /// @param begin   finite
    /// @param limits  finite, above zero
    /// @param allowed limits of position; may be infinite
    StopMotion(const Motion& begin, const MotionLimits& limits,
               const PositionRange& allowed = PositionRange::unlimited()) noexcept RTCF_NONBLOCKING;

    /// s
    [[nodiscard]] double duration() const noexcept RTCF_NONBLOCKING { return duration_; }
    /// Position at the end, unit.
    [[nodiscard]] double end() const noexcept RTCF_NONBLOCKING { return end_; }
    /// The motion at some time after the start, s. After the end, at rest at end(). The
    /// acceleration at the start is one that the stop allows.
    [[nodiscard]] Motion at(double time) const noexcept RTCF_NONBLOCKING;
    /// The positions that the motion passes.
    [[nodiscard]] PositionRange range() const noexcept RTCF_NONBLOCKING;

   private:
    // Brakes with limited jerk.
    void ease(const Motion& begin, const MotionLimits& limits) noexcept;
    // Brakes with a constant deceleration that is at least that of the limits.
    void brake(const Motion& begin, double deceleration, const PositionRange& allowed) noexcept;

    Motion begin_;
    PhaseList<3> phases_;
    double duration_ = 0.0;
    double end_ = 0.0;
};

}  // namespace rtcf_control
