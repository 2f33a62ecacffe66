#include "trajectory/stop_motion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "trajectory/velocity_change.hpp"

namespace rtcf_control {

namespace {

// Rounding errors of positions, relative to them.
constexpr double kPositionTolerance = 1e-12;
// How often the jerk rises fourfold.
constexpr int kMostHarder = 8;

}  // namespace

StopMotion::StopMotion(const Motion& begin, const MotionLimits& limits,
                       const PositionRange& allowed) noexcept RTCF_NONBLOCKING {
    const double tolerance = kPositionTolerance * (1.0 + std::abs(begin.position));
    // Where the axis is already beyond a limit, it may go as far as it has to.
    const double braking = begin.velocity * std::abs(begin.velocity) / (2.0 * limits.acceleration);
    PositionRange most{allowed.lower - tolerance, allowed.upper + tolerance};
    PositionRange to = allowed;
    if (begin.position < most.lower) {
        most.lower = begin.position + std::min(braking, 0.0) - tolerance;
        to.lower = -std::numeric_limits<double>::infinity();
    } else if (begin.position > most.upper) {
        most.upper = begin.position + std::max(braking, 0.0) + tolerance;
        to.upper = std::numeric_limits<double>::infinity();
    }
    MotionLimits harder = limits;
    for (int round = 0; round <= kMostHarder; ++round) {
        ease(begin, harder);
        const PositionRange passed = range();
        if (passed.lower >= most.lower && passed.upper <= most.upper) return;
        harder.jerk *= 4.0;
    }
    brake(begin, limits.acceleration, to);
}

void StopMotion::ease(const Motion& begin, const MotionLimits& limits) noexcept {
    begin_ = withAllowedAcceleration(begin, limits);
    phases_ = VelocityChange(begin_, 0.0, limits).phases();
    duration_ = phases_.duration();
    end_ = phases_.motionAfter(begin_).position;
}

void StopMotion::brake(const Motion& begin, double deceleration,
                       const PositionRange& allowed) noexcept {
    const double speed = std::abs(begin.velocity);
    const double most =
        begin.velocity > 0.0 ? allowed.upper - begin.position : begin.position - allowed.lower;
    const double way = std::max(std::min(speed * speed / (2.0 * deceleration), most), 0.0);
    phases_ = {};
    duration_ = speed > 0.0 ? 2.0 * way / speed : 0.0;
    begin_ = {begin.position, begin.velocity, 0.0};
    end_ = begin.position + std::copysign(way, begin.velocity);
    if (!(duration_ > 0.0)) return;
    begin_.acceleration = -begin.velocity / duration_;
    phases_.add({duration_, 0.0, 0.0});
}

Motion StopMotion::at(double time) const noexcept RTCF_NONBLOCKING {
    if (!(time < duration_)) return {end_, 0.0, 0.0};
    Motion motion = begin_;
    if (!(time > 0.0)) return motion;
    for (const Phase& phase : phases_) {
        if (time < phase.duration) return motion.after(time, phase.jerk);
        motion = phase.after(motion);
        time -= phase.duration;
    }
    return {end_, 0.0, 0.0};
}

PositionRange StopMotion::range() const noexcept RTCF_NONBLOCKING {
    PositionRange range{begin_.position, begin_.position};
    Motion motion = begin_;
    for (const Phase& phase : phases_) {
        range.add(motion, phase.duration, phase.jerk);
        motion = phase.after(motion);
    }
    return range;
}

}  // namespace rtcf_control
