/// @file
/// The motions of one axis that end as far ahead as possible.
#pragma once

#include "trajectory/motion.hpp"

namespace rtcf_control {

/// For each duration: the motion of one axis that ends at a given velocity without acceleration, as
/// far ahead as possible, within limits of velocity, acceleration and jerk.
///
/// By Pontryagin's maximum principle, this motion heads for the largest velocity for some time, and
/// then changes to the velocity at its end as fast as possible. Its phases are
///
///     +jerk, 0 (at the largest acceleration), -jerk, 0 (at the largest velocity),
///     -jerk, 0 (at the largest deceleration), +jerk
///
/// of which some do not last. With a the acceleration at the end of the second phase, -m the one
/// at the end of the fifth phase, J the largest jerk, A the largest acceleration, and (v0, a0), vf
/// the velocities at start and end, a motion that does not reach the largest velocity has
///
///     a² - m² = c = a0²/2 + J (vf - v0)            if neither a nor m is as large as A,
///
/// and the duration T gives a and m in closed form. The derivative of the distance by the duration
/// is v + a (a + m) / (2 J), v being the velocity at the end of the second phase; it is the largest
/// velocity if the motion reaches that one. The distance grows with the duration, but for at most
/// two turning points: it may first grow, then fall, then grow; or fall, then grow. Growth without
/// end follows.
///
/// Sources: Kröger, On-Line Trajectory Generation in Robotic Systems, 2010; Berscheid and Kröger,
/// Jerk-limited Real-time Trajectory Generation with Arbitrary Target States, 2021, for the problem
/// and its profiles. All functions are real-time safe.
class FarthestMotion {
   public:
    /// The end of a motion.
    struct End {
        double distance = 0.0;  ///< from start to end, unit
        double slope = 0.0;     ///< derivative of the distance by the duration, unit/s
    };
    /// Durations between which the distance rises, or falls, only.
    struct TurningPoints {
        std::array<double, 2> durations{};  ///< s, ascending
        std::size_t count = 0;
    };
    using Phases = PhaseList<7>;

    FarthestMotion() = default;
    /// @param begin velocity and acceleration at the start, from which the axis can stay within its
    ///              limits; the position does not matter
    /// @param end_velocity unit/s
    FarthestMotion(const Motion& begin, double end_velocity, const MotionLimits& limits) noexcept
        RTCF_NONBLOCKING;

    /// Shortest duration of a motion to the velocity at the end, s.
    [[nodiscard]] double fastest() const noexcept RTCF_NONBLOCKING { return fastest_; }
    /// Shortest duration of a motion that reaches the largest velocity, s. Beyond, the distance
    /// grows in proportion to the duration.
    [[nodiscard]] double linearFrom() const noexcept RTCF_NONBLOCKING { return linear_from_; }
    /// The durations between fastest() and linearFrom() at which the distance has an extreme.
    [[nodiscard]] TurningPoints turningPoints() const noexcept RTCF_NONBLOCKING;

    /// The end of the motion of a duration of at least fastest().
    [[nodiscard]] End end(double duration) const noexcept RTCF_NONBLOCKING;
    /// The phases of that motion.
    [[nodiscard]] Phases phases(double duration) const noexcept RTCF_NONBLOCKING;
    /// The largest velocity of that motion at which its acceleration is zero, unit/s. No more than
    /// the velocity at its end, if its acceleration is never above zero.
    [[nodiscard]] double peakVelocity(double duration) const noexcept RTCF_NONBLOCKING;

   private:
    // The phases of a motion that does not reach the largest velocity.
    struct Shape {
        double rise;       // acceleration at the end of the second phase, unit/s²
        double fall;       // deceleration at the end of the fifth phase, unit/s²
        double rise_hold;  // duration of the second phase, s
        double fall_hold;  // duration of the sixth phase, s
    };
    [[nodiscard]] Shape shape(double duration) const noexcept;
    // Velocity at the end of the second phase.
    [[nodiscard]] double velocityAfterRise(const Shape& shape) const noexcept;
    [[nodiscard]] double slope(double duration) const noexcept;
    // The duration at which the first phase ends at an acceleration, without a second phase.
    [[nodiscard]] double durationOfRise(double acceleration) const noexcept;
    // The duration at which the slope is the least.
    [[nodiscard]] double flattest() const noexcept;
    // The duration between two at which the slope changes its sign.
    [[nodiscard]] double slopeRoot(double low, double high) const noexcept;

    Motion begin_;
    double end_velocity_ = 0.0;
    MotionLimits limits_;
    double difference_ = 0.0;  // c above, unit²/s⁴
    bool dips_ = false;        // the slope may fall before it rises
    double fastest_ = 0.0;
    double linear_from_ = 0.0;
};

}  // namespace rtcf_control
