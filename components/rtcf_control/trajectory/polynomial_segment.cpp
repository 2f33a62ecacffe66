#include "trajectory/polynomial_segment.hpp"

#include <algorithm>

namespace rtcf_control {

PolynomialSegment::PolynomialSegment(const Motion& begin, const Motion& end, PointKind kind,
                                     double duration) noexcept RTCF_NONBLOCKING
    : begin_(begin.position),
      end_(end.position),
      duration_(std::max(duration, 0.0)) {
    if (!(duration_ > 0.0)) {
        begin_ = end_;
        return;
    }
    const double distance = end.position - begin.position;
    // Velocities and accelerations per unit of x.
    const double v0 = begin.velocity * duration_;
    const double v1 = end.velocity * duration_;
    const double a0 = begin.acceleration * duration_ * duration_;
    const double a1 = end.acceleration * duration_ * duration_;
    auto& c = coefficients_;
    switch (kind) {
        case PointKind::Position:
            c[1] = distance;
            break;
        case PointKind::PositionVelocity:
            c[1] = v0;
            c[2] = 3.0 * distance - 2.0 * v0 - v1;
            c[3] = -2.0 * distance + v0 + v1;
            break;
        case PointKind::PositionVelocityAcceleration:
            c[1] = v0;
            c[2] = a0 / 2.0;
            c[3] = 10.0 * distance - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1;
            c[4] = -15.0 * distance + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1;
            c[5] = 6.0 * distance - 3.0 * (v0 + v1) - 0.5 * a0 + 0.5 * a1;
            break;
    }
}

Motion PolynomialSegment::evaluate(double x) const noexcept {
    double position = 0.0;
    double velocity = 0.0;
    double half_acceleration = 0.0;
    for (auto c = coefficients_.rbegin(); c != coefficients_.rend(); ++c) {
        half_acceleration = half_acceleration * x + velocity;
        velocity = velocity * x + position;
        position = position * x + *c;
    }
    return {begin_ + position, velocity / duration_,
            2.0 * half_acceleration / (duration_ * duration_)};
}

Motion PolynomialSegment::at(double time) const noexcept RTCF_NONBLOCKING {
    if (!(duration_ > 0.0)) return {end_, 0.0, 0.0};
    Motion motion = evaluate(std::clamp(time / duration_, 0.0, 1.0));
    if (time >= duration_) motion.position = end_;
    return motion;
}

}  // namespace rtcf_control
