#include "trajectory/polynomial_segment.hpp"

#include <algorithm>
#include <cstddef>

namespace rtcf_control {

namespace {

using Coefficients = std::array<double, 6>;

// Halvings of the interval. After that, a polynomial is its chord up to 4^-10 of its curvature.
constexpr int kMostSplits = 10;

// The Bernstein coefficients on 0 to 1 of a polynomial of degree 5 in powers.
Coefficients inBernsteinForm(const Coefficients& powers) noexcept {
    constexpr std::array<std::array<double, 6>, 6> kChoose{{{1.0, 0.0, 0.0, 0.0, 0.0, 0.0},
                                                            {1.0, 1.0, 0.0, 0.0, 0.0, 0.0},
                                                            {1.0, 2.0, 1.0, 0.0, 0.0, 0.0},
                                                            {1.0, 3.0, 3.0, 1.0, 0.0, 0.0},
                                                            {1.0, 4.0, 6.0, 4.0, 1.0, 0.0},
                                                            {1.0, 5.0, 10.0, 10.0, 5.0, 1.0}}};
    Coefficients bernstein{};
    for (std::size_t i = 0; i < powers.size(); ++i) {
        for (std::size_t k = 0; k <= i; ++k)
            bernstein[i] += kChoose[i][k] / kChoose[5][k] * powers[k];
    }
    return bernstein;
}

bool isWithin(const Coefficients& bernstein, const PositionRange& range, int halvings) noexcept {
    const auto [least, largest] = std::minmax_element(bernstein.begin(), bernstein.end());
    if (*least >= range.lower && *largest <= range.upper) return true;
    for (const double end : {bernstein.front(), bernstein.back()}) {
        if (end < range.lower || end > range.upper) return false;
    }
    if (halvings == 0) return true;
    Coefficients left{};
    Coefficients right = bernstein;
    for (std::size_t round = 0; round < right.size(); ++round) {
        left[round] = right[0];
        for (std::size_t i = 0; i + round + 1 < right.size(); ++i)
            right[i] = (right[i] + right[i + 1]) / 2.0;
    }
    return isWithin(left, range, halvings - 1) && isWithin(right, range, halvings - 1);
}

}  // namespace

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

bool PolynomialSegment::staysWithin(const PositionRange& positions, double speed) const noexcept
    RTCF_NONBLOCKING {
    if (!isWithin(inBernsteinForm(coefficients_),
                  {positions.lower - begin_, positions.upper - begin_}, kMostSplits))
        return false;
    Coefficients velocity{};
    for (std::size_t k = 0; k + 1 < coefficients_.size(); ++k)
        velocity[k] = static_cast<double>(k + 1) * coefficients_[k + 1];
    const double most = speed * duration_;
    return !(duration_ > 0.0) || isWithin(inBernsteinForm(velocity), {-most, most}, kMostSplits);
}

}  // namespace rtcf_control
