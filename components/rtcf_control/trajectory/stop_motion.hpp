/// @file
/// The fastest stop of one axis.
#pragma once

#include "trajectory/motion.hpp"

namespace rtcf_control {

/// The motion of one axis from any state to rest, as fast as possible, under limits of acceleration
/// and jerk. An acceleration beyond its limit returns to it first. The motion also has the shortest
/// way of all stops: it never passes the target of a motion within the same limits that ends at
/// rest. All functions are real-time safe.
class StopMotion {
   public:
    /// At rest at position 0.
    StopMotion() = default;
    /// @param begin  finite
    /// @param limits finite, above zero
    StopMotion(const Motion& begin, const MotionLimits& limits) noexcept RTCF_NONBLOCKING;

    /// s
    [[nodiscard]] double duration() const noexcept RTCF_NONBLOCKING { return duration_; }
    /// Position at the end, unit.
    [[nodiscard]] double end() const noexcept RTCF_NONBLOCKING { return end_; }
    /// The motion at some time after the start, s. After the end, at rest at end().
    [[nodiscard]] Motion at(double time) const noexcept RTCF_NONBLOCKING;
    /// The positions that the motion passes.
    [[nodiscard]] PositionRange range() const noexcept RTCF_NONBLOCKING;

   private:
    Motion begin_;
    PhaseList<4> phases_;
    double duration_ = 0.0;
    double end_ = 0.0;
};

}  // namespace rtcf_control
