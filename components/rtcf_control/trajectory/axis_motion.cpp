#include "trajectory/axis_motion.hpp"

#include <algorithm>
#include <cmath>

#include "trajectory/velocity_change.hpp"

namespace rtcf_control {

namespace {

// Velocities that exceed the limit by less than this part of it count as rounding errors.
constexpr double kLimitTolerance = 1e-12;
// Rounding errors of a distance, relative to the positions and the motions it is computed from.
constexpr double kDistanceTolerance = 4e-15;
// The same, for a motion that has been planned again many times, relative to the motion that speeds
// up to the largest velocity.
constexpr double kArrivalTolerance = 1e-12;
constexpr double kDurationTolerance = 1e-15;
constexpr int kMostRounds = 100;

double squared(double value) noexcept { return value * value; }

// True if the motion is beyond the upper limit of acceleration or velocity, or will unavoidably be.
bool isAboveLimits(const Motion& motion, const MotionLimits& limits) noexcept {
    if (motion.acceleration > limits.acceleration) return true;
    const double largest = limits.velocity * (1.0 + kLimitTolerance);
    const double eased = motion.easedVelocity(limits.jerk);
    if (motion.acceleration > 0.0) return eased > largest;
    return motion.velocity > largest && eased >= -limits.velocity;
}

// Brings a motion back that is beyond the upper limits, as fast as possible, as long as it can stay
// above the lower limit of velocity. Changes `motion` to the motion after that.
PhaseList<2> returnFromAbove(Motion& motion, const MotionLimits& limits) noexcept {
    const double jerk = limits.jerk;
    const double largest = limits.acceleration;
    const double a = motion.acceleration;
    PhaseList<2> phases;
    const auto add = [&](const Phase& phase) {
        if (!(phase.duration > 0.0)) return;
        phases.add(phase);
        motion = phase.after(motion);
    };
    // While an acceleration of `largest` is eased, the velocity changes by that much.
    const double easing = squared(largest) / (2.0 * jerk);
    const double eased = motion.easedVelocity(jerk);
    if (a > 0.0 && eased <= limits.velocity * (1.0 + kLimitTolerance)) {
        add({(a - largest) / jerk, -jerk, largest});
        if (motion.velocity < -limits.velocity) {
            add({std::min(-limits.velocity - motion.velocity,
                          limits.velocity - easing - motion.velocity) /
                     largest,
                 0.0, largest});
        }
        return phases;
    }
    // The deceleration at which the velocity is back at its limit, and the one at which easing must
    // begin for the lower limit.
    const double at_limit =
        std::sqrt(std::max(squared(a) + 2.0 * jerk * (motion.velocity - limits.velocity), 0.0));
    const double at_guard =
        std::sqrt(std::max(squared(a) / 2.0 + jerk * (motion.velocity + limits.velocity), 0.0));
    const double deceleration = std::max(std::min({at_limit, at_guard, largest}), -a);
    add({(a + deceleration) / jerk, -jerk, -deceleration});
    if (at_limit <= deceleration) {
        motion.velocity = limits.velocity;
    } else if (deceleration < at_guard) {
        add({std::min(motion.velocity - limits.velocity,
                      motion.velocity - easing + limits.velocity) /
                 largest,
             0.0, -largest});
    }
    return phases;
}

// A place in a list of phases.
class PhaseCursor {
   public:
    PhaseCursor(const FarthestMotion::Phases& phases, double acceleration) noexcept
        : next_(phases.begin()), end_(phases.end()), acceleration_(acceleration) {
        if (!done()) left_ = next_->duration;
    }
    [[nodiscard]] bool done() const noexcept { return next_ == end_; }
    // Time to the end of the phase, s.
    [[nodiscard]] double left() const noexcept { return left_; }
    [[nodiscard]] double jerk() const noexcept { return next_->jerk; }
    [[nodiscard]] double acceleration() const noexcept { return acceleration_; }
    // Moves on by no more than left().
    void advance(double time) noexcept {
        left_ -= time;
        if (left_ > 0.0) {
            acceleration_ += time * next_->jerk;
            return;
        }
        acceleration_ = next_->acceleration;
        ++next_;
        left_ = done() ? 0.0 : next_->duration;
    }

   private:
    const Phase* next_;
    const Phase* end_;
    double left_ = 0.0;
    double acceleration_;
};

}  // namespace

void AxisMotion::prepare(const Motion& begin, const MotionTarget& target,
                         const MotionLimits& limits) noexcept RTCF_NONBLOCKING {
    begin_ = begin;
    target_ = target;
    limits_ = limits;
    blocked_count_ = 0;
    piece_count_ = 0;
    duration_ = 0.0;

    returned_ = {0.0, begin.velocity, begin.acceleration};
    return_ = PhaseList<2>();
    const bool below = returned_.acceleration < -limits.acceleration;
    if (!below && isAboveLimits(returned_, limits)) {
        return_ = returnFromAbove(returned_, limits);
    } else if (below || isAboveLimits(returned_.mirrored(), limits)) {
        returned_ = returned_.mirrored();
        return_ = returnFromAbove(returned_, limits);
        return_.mirror();
        returned_ = returned_.mirrored();
    }
    return_duration_ = return_.duration();

    // A velocity within the tolerance of the limit becomes the limit.
    const double eased = returned_.easedVelocity(limits.jerk);
    const double over = std::max({limits.velocity, eased, target.velocity});
    const double under = std::max({limits.velocity, -eased, -target.velocity});
    forward_ = FarthestMotion(returned_, target.velocity, {over, limits.acceleration, limits.jerk});
    backward_ = FarthestMotion(returned_.mirrored(), -target.velocity,
                               {under, limits.acceleration, limits.jerk});

    distance_ = target.position - begin.position - returned_.position;
    const double time = forward_.fastest();
    const double speed = over + under + std::abs(returned_.velocity);
    const double acceleration = limits.acceleration + std::abs(begin.acceleration);
    const double travel = (speed + acceleration * time) * time;
    tolerance_ = kDistanceTolerance * (std::abs(begin.position) + std::abs(target.position) +
                                       std::abs(returned_.position) + travel);
    const double ramp =
        limits.velocity / limits.acceleration + std::sqrt(limits.velocity / limits.jerk);
    arrival_tolerance_ = tolerance_ + kArrivalTolerance * (travel + limits.velocity * ramp);

    block(-return_duration_ - 1.0, forward_.fastest());
    blockShort(forward_, distance_);
    blockShort(backward_, -distance_);
}

void AxisMotion::block(double above, double below) noexcept {
    if (blocked_count_ < blocked_.size() && above < below)
        blocked_[blocked_count_++] = {above + return_duration_, below + return_duration_};
}

void AxisMotion::blockShort(const FarthestMotion& farthest, double distance) noexcept {
    const FarthestMotion::TurningPoints turning = farthest.turningPoints();
    double from = farthest.fastest();
    double missing = distance - farthest.end(from).distance;
    if (std::abs(missing) <= arrival_tolerance_) missing = 0.0;
    double blocked_from = -return_duration_ - 1.0;
    for (std::size_t i = 0; i <= turning.count; ++i) {
        const double to = i < turning.count ? turning.durations[i] : farthest.linearFrom();
        const double missing_then = distance - farthest.end(to).distance;
        if (missing > 0.0 && missing_then <= 0.0) {
            block(blocked_from, solve(farthest, distance, from, to));
        } else if (missing <= 0.0 && missing_then > 0.0) {
            blocked_from = missing == 0.0 ? from : solve(farthest, distance, from, to);
        }
        from = to;
        missing = missing_then;
    }
    if (missing > 0.0) block(blocked_from, from + missing / farthest.end(from).slope);
}

double AxisMotion::solve(const FarthestMotion& farthest, double distance, double low,
                         double high) const noexcept {
    const bool rises = farthest.end(high).distance >= distance;
    double guess = low + (high - low) / 2.0;
    double last_step = high - low;
    for (int round = 0; round < kMostRounds; ++round) {
        const FarthestMotion::End end = farthest.end(guess);
        const double error = end.distance - distance;
        if (std::abs(error) <= tolerance_ / 8.0) return guess;
        ((error > 0.0) == rises ? high : low) = guess;
        // Newton's method, or bisection where that one leaves the interval or is slow.
        double next = guess - error / end.slope;
        const bool useful = next > low && next < high && std::abs(next - guess) < last_step / 2.0;
        if (!useful) next = low + (high - low) / 2.0;
        last_step = std::abs(next - guess);
        if (last_step <= kDurationTolerance * high) return next;
        guess = next;
    }
    return guess;
}

double AxisMotion::feasible(double duration) const noexcept RTCF_NONBLOCKING {
    // Each round leaves an interval for good, as the duration grows only.
    for (std::size_t round = 0; round < blocked_count_; ++round) {
        for (std::size_t i = 0; i < blocked_count_; ++i) {
            const Blocked& blocked = blocked_[i];
            if (duration > blocked.above && duration < blocked.below) duration = blocked.below;
        }
    }
    return duration;
}

void AxisMotion::plan(double duration) noexcept RTCF_NONBLOCKING {
    piece_count_ = 0;
    duration_ = duration;
    end_ = {0.0, begin_.velocity, begin_.acceleration};
    double time = 0.0;
    const auto append = [&](const Phase& phase) {
        if (piece_count_ == pieces_.size()) return;
        pieces_[piece_count_++] = {time, phase.jerk, end_};
        end_ = phase.after(end_);
        time += phase.duration;
    };
    for (const Phase& phase : return_) append(phase);
    end_ = returned_;
    for (const Phase& phase : phases(std::max(duration - return_duration_, forward_.fastest())))
        append(phase);
}

AxisMotion::Phases AxisMotion::phases(double duration) const noexcept {
    Phases phases;
    const double farthest = forward_.end(duration).distance;
    const double nearest = -backward_.end(duration).distance;
    if (distance_ >= farthest - tolerance_) {
        phases.add(forward_.phases(duration));
    } else if (distance_ <= nearest + tolerance_) {
        phases.add(backward_.phases(duration));
        phases.mirror();
    } else if (!cruise(duration, phases)) {
        phases = mean(duration, (distance_ - nearest) / (farthest - nearest));
    }
    return phases;
}

bool AxisMotion::cruise(double duration, Phases& phases) const noexcept {
    struct Error {
        double distance;
        double cruise;  // duration of the phase of constant velocity, s
    };
    const auto errorAt = [&](double velocity) -> Error {
        const VelocityChange first(returned_, velocity, limits_);
        const VelocityChange second({0.0, velocity, 0.0}, target_.velocity, limits_);
        const double time = duration - first.duration() - second.duration();
        return {first.distance() + velocity * time + second.distance() - distance_, time};
    };
    // The distance grows with the velocity, wherever the phase of constant velocity has a duration
    // above zero. It has one at the target's velocity, and at the extremes it has none or more.
    double low = target_.velocity;
    double high = target_.velocity;
    Error at_low = errorAt(low);
    Error at_high = at_low;
    if (at_low.distance < 0.0) {
        high = std::max(forward_.peakVelocity(duration), low);
        at_high = errorAt(high);
    } else {
        low = std::min(-backward_.peakVelocity(duration), high);
        at_low = errorAt(low);
    }
    if (at_low.distance > 0.0 || at_high.distance < 0.0) return false;

    double velocity = low;
    Error found = at_low;
    double low_weight = at_low.distance;
    double high_weight = at_high.distance;
    int side = 0;
    for (int round = 0; round < kMostRounds; ++round) {
        // The Illinois method: regula falsi, in which an end that stays loses half of its weight.
        velocity = (low * high_weight - high * low_weight) / (high_weight - low_weight);
        const bool inside = velocity > low && velocity < high;
        if (!inside) velocity = low + (high - low) / 2.0;
        found = errorAt(velocity);
        if (std::abs(found.distance) <= tolerance_) break;
        if (found.distance < 0.0) {
            low = velocity;
            low_weight = found.distance;
            if (side < 0) high_weight /= 2.0;
            side = -1;
        } else {
            high = velocity;
            high_weight = found.distance;
            if (side > 0) low_weight /= 2.0;
            side = 1;
        }
    }
    if (std::abs(found.distance) > 8.0 * tolerance_ ||
        found.cruise < -kDurationTolerance * duration)
        return false;
    phases.add(VelocityChange(returned_, velocity, limits_).phases());
    phases.add({found.cruise, 0.0, 0.0});
    phases.add(VelocityChange({0.0, velocity, 0.0}, target_.velocity, limits_).phases());
    return true;
}

AxisMotion::Phases AxisMotion::mean(double duration, double weight) const noexcept {
    const double forward_weight = std::clamp(weight, 0.0, 1.0);
    const double backward_weight = 1.0 - forward_weight;
    const FarthestMotion::Phases forward_phases = forward_.phases(duration);
    const FarthestMotion::Phases backward_phases = backward_.phases(duration);
    PhaseCursor forward(forward_phases, returned_.acceleration);
    PhaseCursor backward(backward_phases, -returned_.acceleration);
    Phases phases;
    // Each round ends a phase of one list.
    while (!forward.done() && !backward.done()) {
        Phase phase;
        phase.duration = std::min(forward.left(), backward.left());
        phase.jerk = forward_weight * forward.jerk() - backward_weight * backward.jerk();
        forward.advance(phase.duration);
        backward.advance(phase.duration);
        phase.acceleration =
            forward_weight * forward.acceleration() - backward_weight * backward.acceleration();
        phases.add(phase);
    }
    return phases;
}

Motion AxisMotion::at(double time) const noexcept RTCF_NONBLOCKING {
    if (!(time > 0.0)) return begin_;
    if (time >= duration_ || piece_count_ == 0) {
        return {target_.position + target_.velocity * (time - duration_), target_.velocity, 0.0};
    }
    std::size_t i = piece_count_ - 1;
    while (i > 0 && time < pieces_[i].begin) --i;
    Motion motion = pieces_[i].motion.after(time - pieces_[i].begin, pieces_[i].jerk);
    motion.position += begin_.position;
    return motion;
}

PositionRange AxisMotion::range() const noexcept RTCF_NONBLOCKING {
    PositionRange range{begin_.position, begin_.position};
    for (std::size_t i = 0; i < piece_count_; ++i) {
        Motion begin = pieces_[i].motion;
        begin.position += begin_.position;
        const double end = i + 1 < piece_count_ ? pieces_[i + 1].begin : duration_;
        range.add(begin, end - pieces_[i].begin, pieces_[i].jerk);
    }
    return range;
}

Motion AxisMotion::roundingError() const noexcept RTCF_NONBLOCKING {
    return {target_.position - begin_.position - end_.position, target_.velocity - end_.velocity,
            -end_.acceleration};
}

}  // namespace rtcf_control
