#include "trajectory/farthest_motion.hpp"

#include <algorithm>
#include <cmath>

#include "trajectory/velocity_change.hpp"

namespace rtcf_control {

namespace {

// Near an extreme, the distance depends on the square of the error of the duration.
constexpr double kTurningPointTolerance = 1e-10;
constexpr int kMostHalvings = 60;

}  // namespace

FarthestMotion::FarthestMotion(const Motion& begin, double end_velocity,
                               const MotionLimits& limits) noexcept RTCF_NONBLOCKING
    : begin_{0.0, begin.velocity, begin.acceleration},
      end_velocity_(end_velocity),
      limits_(limits) {
    const VelocityChange direct(begin_, end_velocity, limits);
    const VelocityChange up(begin_, limits.velocity, limits);
    const VelocityChange down({0.0, limits.velocity, 0.0}, end_velocity, limits);
    const double a0 = begin_.acceleration;
    difference_ = limits.jerk * direct.change() + (a0 > 0.0 ? a0 * a0 : 0.0);
    dips_ = direct.falls() && a0 < 0.0;
    fastest_ = direct.duration();
    linear_from_ = std::max(up.duration() + down.duration(), fastest_);
}

FarthestMotion::Shape FarthestMotion::shape(double duration) const noexcept {
    const double largest = limits_.acceleration;
    const double c = difference_;
    const double a0 = begin_.acceleration;
    const double total = limits_.jerk * duration + a0;

    // Neither acceleration reaches its limit: a + m = total / 2, (a + m) (a - m) = c.
    const double sum = total / 2.0;
    const double rest = sum > 0.0 ? c / sum : 0.0;
    Shape shape{(sum + rest) / 2.0, (sum - rest) / 2.0, 0.0, 0.0};
    if (shape.rise > largest && shape.rise >= shape.fall) {
        shape.rise = largest;
        shape.fall = std::sqrt(std::max(largest * total - c, 0.0)) - largest;
        shape.rise_hold = shape.fall * shape.fall + c - largest * largest;
    } else if (shape.fall > largest) {
        shape.fall = largest;
        shape.rise = std::sqrt(std::max(largest * total + c, 0.0)) - largest;
        shape.fall_hold = shape.rise * shape.rise - c - largest * largest;
    }
    if (shape.rise >= largest && shape.fall >= largest) {
        shape.rise = shape.fall = largest;
        shape.rise_hold = (largest * (total - 4.0 * largest) + c) / 2.0;
        shape.fall_hold = (largest * (total - 4.0 * largest) - c) / 2.0;
    }
    shape.rise = std::max(shape.rise, a0);
    shape.fall = std::max({shape.fall, -shape.rise, 0.0});
    shape.rise_hold = std::max(shape.rise_hold, 0.0) / (largest * limits_.jerk);
    shape.fall_hold = std::max(shape.fall_hold, 0.0) / (largest * limits_.jerk);
    return shape;
}

double FarthestMotion::velocityAfterRise(const Shape& shape) const noexcept {
    const double a0 = begin_.acceleration;
    return begin_.velocity + (shape.rise - a0) * (shape.rise + a0) / (2.0 * limits_.jerk) +
           shape.rise * shape.rise_hold;
}

FarthestMotion::Phases FarthestMotion::phases(double duration) const noexcept RTCF_NONBLOCKING {
    const double jerk = limits_.jerk;
    Phases phases;
    if (duration >= linear_from_) {
        const VelocityChange up(begin_, limits_.velocity, limits_);
        const VelocityChange down({0.0, limits_.velocity, 0.0}, end_velocity_, limits_);
        phases.add(up.phases());
        phases.add({duration - up.duration() - down.duration(), 0.0, 0.0});
        phases.add(down.phases());
        return phases;
    }
    const Shape found = shape(duration);
    phases.add({(found.rise - begin_.acceleration) / jerk, jerk, found.rise});
    phases.add({found.rise_hold, 0.0, found.rise});
    phases.add({(found.rise + found.fall) / jerk, -jerk, -found.fall});
    phases.add({found.fall_hold, 0.0, -found.fall});
    phases.add({found.fall / jerk, jerk, 0.0});
    return phases;
}

FarthestMotion::End FarthestMotion::end(double duration) const noexcept RTCF_NONBLOCKING {
    return {phases(duration).motionAfter(begin_).position, slope(duration)};
}

double FarthestMotion::slope(double duration) const noexcept {
    if (duration >= linear_from_) return limits_.velocity;
    const Shape found = shape(duration);
    return velocityAfterRise(found) + found.rise * (found.rise + found.fall) / (2.0 * limits_.jerk);
}

double FarthestMotion::peakVelocity(double duration) const noexcept RTCF_NONBLOCKING {
    if (duration >= linear_from_) return limits_.velocity;
    const Shape found = shape(duration);
    return velocityAfterRise(found) + found.rise * std::abs(found.rise) / (2.0 * limits_.jerk);
}

FarthestMotion::TurningPoints FarthestMotion::turningPoints() const noexcept RTCF_NONBLOCKING {
    TurningPoints points;
    const double least = flattest();
    if (!(slope(least) < 0.0)) return points;
    if (slope(fastest_) > 0.0) points.durations[points.count++] = slopeRoot(fastest_, least);
    points.durations[points.count++] = slopeRoot(least, linear_from_);
    return points;
}

double FarthestMotion::durationOfRise(double acceleration) const noexcept {
    const double largest = limits_.acceleration;
    const double fall_square = std::max(acceleration * acceleration - difference_, 0.0);
    const double hold = std::max(fall_square / largest - largest, 0.0);
    const double fall = std::min(std::sqrt(fall_square), largest);
    return (2.0 * (acceleration + fall) + hold - begin_.acceleration) / limits_.jerk;
}

double FarthestMotion::flattest() const noexcept {
    if (!dips_) return fastest_;
    // See the header for a, m and A. The slope grows with a for a >= 0. For a < 0, the derivative
    // of the slope with respect to a has the sign of A + 4 a if the motion has a phase at the
    // largest deceleration, and else the sign of m² + 4 a m + a².
    const double largest = limits_.acceleration;
    const double c = difference_;
    double rise = -largest / 4.0;
    if (rise * rise - c < largest * largest) {
        rise = -std::sqrt(std::max(-c, 0.0) / (6.0 + 4.0 * std::sqrt(3.0)));
        if (rise * rise - c > largest * largest)
            rise = -std::sqrt(std::max(largest * largest + c, 0.0));
    }
    return std::clamp(durationOfRise(std::max(rise, begin_.acceleration)), fastest_, linear_from_);
}

double FarthestMotion::slopeRoot(double low, double high) const noexcept {
    const bool rises = slope(low) < 0.0;
    for (int round = 0; round < kMostHalvings && high - low > kTurningPointTolerance * high;
         ++round) {
        const double middle = low + (high - low) / 2.0;
        ((slope(middle) < 0.0) == rises ? low : high) = middle;
    }
    return low + (high - low) / 2.0;
}

}  // namespace rtcf_control
