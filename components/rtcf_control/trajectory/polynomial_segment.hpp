/// @file
/// The motion of one axis between two points of a trajectory that gives times.
#pragma once

#include <array>

#include "trajectory/motion.hpp"

namespace rtcf_control {

/// The values of a point of a trajectory. A trajectory_msgs/JointTrajectoryPoint without velocities
/// or accelerations has empty lists of them.
enum class PointKind { Position, PositionVelocity, PositionVelocityAcceleration };

/// A polynomial of the time between two points: a quintic one if both give accelerations, a cubic
/// one if both give velocities, and otherwise a straight line, whose velocity jumps at the points.
/// It obeys no limits: the points and the times between them determine it.
///
/// Source: Hermite interpolation; e.g. Biagiotti and Melchiorri, Trajectory Planning for Automatic
/// Machines and Robots, 2008, chapter 2. All functions are real-time safe.
class PolynomialSegment {
   public:
    /// At rest at position 0.
    PolynomialSegment() = default;
    /// @param begin    values that `kind` does not name are ignored
    /// @param end      values that `kind` does not name are ignored
    /// @param kind     the values that both points have
    /// @param duration s; the segment is a step if it is not above zero
    PolynomialSegment(const Motion& begin, const Motion& end, PointKind kind,
                      double duration) noexcept RTCF_NONBLOCKING;

    /// s
    [[nodiscard]] double duration() const noexcept RTCF_NONBLOCKING { return duration_; }
    /// The motion at some time after the start, s. Before the start and after the end, the motion
    /// at the start or the end. At the end, its position is exactly that of the point.
    [[nodiscard]] Motion at(double time) const noexcept RTCF_NONBLOCKING;
    /// True if positions and velocities stay within limits between start and end, up to about a
    /// millionth of their change. Exact at both ends. The number of steps is bounded.
    ///
    /// Source: a polynomial stays within the range of its Bernstein coefficients, which de
    /// Casteljau's subdivision narrows; e.g. Farin, Curves and Surfaces for CAGD, 2002, chapter 6.
    /// @param speed largest velocity in both directions, unit/s
    [[nodiscard]] bool staysWithin(const PositionRange& positions, double speed) const noexcept
        RTCF_NONBLOCKING;

   private:
    [[nodiscard]] Motion evaluate(double x) const noexcept;

    // Of x = time / duration, lowest power first. The position is relative to that at the start.
    std::array<double, 6> coefficients_{};
    double begin_ = 0.0;
    double end_ = 0.0;
    double duration_ = 0.0;
};

/// The values that both points have. Real-time safe.
[[nodiscard]] constexpr PointKind commonKind(PointKind one, PointKind other) noexcept {
    return one < other ? one : other;
}

}  // namespace rtcf_control
