#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include <rtcf/component.hpp>

#include "bounded_step.hpp"
#include "measurement_watch.hpp"

namespace rtcf_control {
namespace {

// Largest constant velocity of one period from which a joint stops within a distance, if it slows
// down by `acceleration` times the period in each later period: the inverse of
// D(v) = h ((n + 1) v - n (n + 1) / 2 a h), n = floor(v / (a h)). Real-time safe.
/// @param distance 0 or above
/// @param acceleration above 0; infinite = the joint may stop at once
double brakingVelocity(double distance, double acceleration, double period_s) {
    const double unit = acceleration * period_s * period_s;
    if (std::isinf(distance) || std::isinf(unit)) return distance / period_s;
    const double relative = distance / unit;
    const double n = std::floor(0.5 * (std::sqrt(1.0 + 8.0 * relative) - 1.0));
    return acceleration * period_s * (relative / (n + 1.0) + 0.5 * n);
}

enum class Command { Position, Velocity, Effort };

class JointLimiter final : public rtcf::Component {
    static constexpr double kInfinity = std::numeric_limits<double>::infinity();

    struct Range {
        double low;
        double high;
        double limit(double value) const { return std::clamp(value, low, high); }
    };

    rtcf::Input<double> in{this, "in"};
    rtcf::Input<double> position{this, "position"};
    rtcf::Input<double> velocity{this, "velocity"};
    rtcf::Output<double> out{this, "out", "", rtcf::Finite()};
    rtcf::Output<bool> limited{this, "limited"};

    rtcf::Parameter<Command> command{
        this,
        "command",
        Command::Position,
        rtcf::Choice("position", Command::Position),
        rtcf::Choice("velocity", Command::Velocity),
        rtcf::Choice("effort", Command::Effort),
        rtcf::Doc("quantity of in and out; position and velocity: the measured ones")};
    rtcf::Parameter<double> lower{this, "lower", -kInfinity, rtcf::Unit("rad"),
                                  rtcf::Doc("lowest position")};
    rtcf::Parameter<double> upper{this, "upper", kInfinity, rtcf::Unit("rad"),
                                  rtcf::Doc("highest position")};
    rtcf::Parameter<double> soft_lower{this, "soft_lower", -kInfinity, rtcf::Unit("rad"),
                                       rtcf::Doc("lower soft limit")};
    rtcf::Parameter<double> soft_upper{this, "soft_upper", kInfinity, rtcf::Unit("rad"),
                                       rtcf::Doc("upper soft limit")};
    rtcf::Parameter<double> max_velocity{
        this,           "max_velocity",      kInfinity,
        rtcf::Min(0.0), rtcf::Unit("rad/s"), rtcf::Doc("largest velocity, either way; 0 holds")};
    rtcf::Parameter<double> deceleration{
        this,
        "deceleration",
        kInfinity,
        rtcf::Min(1e-9),
        rtcf::Unit("rad/s^2"),
        rtcf::Doc("largest acceleration of a position or velocity command, either way, and that of "
                  "the braking distance before lower and upper")};
    rtcf::Parameter<double> max_effort{
        this,           "max_effort",      kInfinity,
        rtcf::Min(0.0), rtcf::Unit("N m"), rtcf::Doc("largest effort, either way")};
    rtcf::Parameter<double> k_position{
        this,           "k_position",      10.0,
        rtcf::Min(0.0), rtcf::Unit("1/s"), rtcf::Doc("velocity by distance to a soft limit")};
    rtcf::Parameter<double> k_velocity{
        this,
        "k_velocity",
        0.0,
        rtcf::Min(0.0),
        rtcf::Unit("N m s/rad"),
        rtcf::Doc("effort by excess velocity; needed for limits of position or velocity")};
    MeasurementWatch<2> watch_{
        this, {"position", "velocity"}, "a velocity slows down to 0, an effort is 0"};

    rtcf::State<double> last_{this, "last", 0.0, rtcf::Doc("the last output"), rtcf::Live()};
    rtcf::State<double> pace_{this,
                              "pace",
                              0.0,
                              rtcf::Unit("rad/s"),
                              rtcf::Doc("velocity of the last position or velocity command"),
                              rtcf::Live()};
    rtcf::State<double> wanted_{this, "last_wanted", 0.0, rtcf::Doc("last wanted position"),
                                rtcf::Live()};
    rtcf::State<double> travel_{this,
                                "travel",
                                0.0,
                                rtcf::Unit("rad"),
                                rtcf::Doc("way of the joint since the last position, estimated"),
                                rtcf::Live()};
    rtcf::State<std::int32_t> kind_{this, "kind", -1, rtcf::Doc("command of the last cycle"),
                                    rtcf::Live()};
    rtcf::State<bool> begun_{this, "begun", false, rtcf::Doc("the last output is valid"),
                             rtcf::Live()};

    bool prepare(const rtcf::Values& proposed) override {
        if (proposed[lower] > proposed[upper])
            return RTCF_FAIL(this, "lower = {} is above upper = {}", proposed[lower],
                             proposed[upper]);
        if (proposed[soft_lower] > proposed[soft_upper])
            return RTCF_FAIL(this, "soft_lower = {} is above soft_upper = {}", proposed[soft_lower],
                             proposed[soft_upper]);
        const bool soft =
            std::isfinite(proposed[soft_lower]) || std::isfinite(proposed[soft_upper]);
        if (soft && proposed[k_position] == 0.0)
            return fail("soft limits need a k_position above 0");
        if (proposed[command] != Command::Effort) return true;
        const bool hard = std::isfinite(proposed[lower]) || std::isfinite(proposed[upper]);
        if (hard && std::isinf(proposed[deceleration]))
            return fail(
                "command = effort with limits of the position needs a deceleration (rad/s^2) that "
                "the joint reaches with max_effort: it brakes by it before the limit");
        if ((hard || soft || std::isfinite(proposed[max_velocity])) && proposed[k_velocity] == 0.0)
            return fail(
                "command = effort with limits of position or velocity needs a k_velocity (N m "
                "s/rad) above 0: the braking effort by excess velocity");
        return true;
    }

    bool start() override {
        begun_ = false;
        pace_ = 0.0;
        travel_ = 0.0;
        watch_.begin();
        return true;
    }

    void update() override {
        const auto kind = static_cast<std::int32_t>(command.value());
        begun_ = begun_ && kind_ == kind;  // the last output is another quantity
        kind_ = kind;
        const bool moved = position.read() == rtcf::DataStatus::New &&
                           std::isfinite(position.value()) && position.value() != watch_.last(0);
        const bool has_position =
            note(position, 0, command == Command::Position ? !begun_ : needsPosition());
        const bool has_velocity = note(velocity, 1, command == Command::Effort && needsVelocity());
        travel(moved);
        if (in.read() == rtcf::DataStatus::None) return;
        double wanted = in.value();
        if (!std::isfinite(wanted)) {
            reportFault("in is not finite: the last output or target counts");
            if (!begun_) return;
            wanted = command == Command::Position ? wanted_ : last_;
        }
        switch (command.value()) {
            case Command::Position:
                if (!begun_ && !begin(wanted)) return;
                write(wanted, followed(wanted, last_));
                return;
            case Command::Velocity:
                if (needsPosition() && !has_position) return;
                write(wanted, needsPosition() && watch_.lost(0)
                                  ? slower()
                                  : velocities(place()).limit(wanted));
                pace_ = last_.value();
                return;
            case Command::Effort: {
                if ((needsPosition() && !has_position) || (needsVelocity() && !has_velocity))
                    return;
                const bool lost =
                    (needsPosition() && watch_.lost(0)) || (needsVelocity() && watch_.lost(1));
                write(wanted, lost ? 0.0 : efforts(place(), watch_.last(1)).limit(wanted));
                pace_ = 0.0;
                return;
            }
        }
    }

    // Holds the position, or commands no velocity or effort.
    void safe() noexcept override {
        if (command != Command::Position) {
            out.write(0.0);
        } else if (begun_) {
            out.write(last_);
        }
    }

    bool needsPosition() const {
        return std::isfinite(lower) || std::isfinite(upper) || std::isfinite(soft_lower) ||
               std::isfinite(soft_upper);
    }
    bool needsVelocity() const { return needsPosition() || std::isfinite(max_velocity); }

    // Reads a measured input; watches it if it is needed.
    // @return it has a value; a needed one: it has had a finite value
    bool note(rtcf::Input<double>& measured, std::size_t i, bool needed) {
        if (measured.read() == rtcf::DataStatus::None) return false;
        if (!needed) return true;
        const char* const fault = watch_.note(i, measured.value(), measured.age(this), elapsed());
        if (fault != nullptr) reportFault(fault);
        return watch_.valid(i);
    }

    // Begins at the measured position, so that the joint does not jump.
    // @return false if the position has not come yet, is not finite, or too old
    bool begin(double wanted) {
        wanted_ = last_ = Range{lower, upper}.limit(wanted);
        if (position.read() == rtcf::DataStatus::None) return !position.connected(this);
        if (!std::isfinite(position.value()) || watch_.lost(0)) return false;
        last_ = position.value();
        return true;
    }

    // Estimates the way of the joint since the last change of the position, which may be slower
    // than the loop, or frozen.
    void travel(bool moved) {
        const double v = command == Command::Effort ? watch_.last(1) : pace_.value();
        travel_ = moved || !std::isfinite(v) ? 0.0 : travel_ + v * dt();
    }
    // Where the joint may be.
    Range place() const {
        const double x = watch_.last(0);
        return {std::min(x, x + travel_), std::max(x, x + travel_)};
    }

    void write(double wanted, double value) {
        out.write(value);
        limited.write(value != wanted);
        last_ = value;
        begun_ = true;
    }

    // A velocity on the way to 0.
    double slower() const {
        const double change = deceleration * step();
        return Range{-std::max(0.0, -pace_ - change), std::max(0.0, pace_ - change)}.limit(pace_);
    }

    // Position of this cycle on the way from the last one. `wanted` may move itself: the way slows
    // down before it relative to its velocity.
    double followed(double wanted, double from) {
        const double h = step();
        const double target = Range{lower, upper}.limit(wanted);
        const double drift = (target - wanted_) / h;
        const double distance = wanted_ - from;
        wanted_ = target;
        double speed = (target - from) / h;
        if (std::isfinite(deceleration)) {
            const double approach = brakingVelocity(std::abs(distance), deceleration, periodOf());
            speed = drift + std::copysign(approach, distance);
        }
        const double v = velocities({from, from}).limit(speed);
        // Exactly there if only rounding is left.
        const double rest = std::abs(target - from - v * h);
        const double next = rest <= 1e-12 * std::abs(target - from) ? target : from + v * h;
        // Rounding must not cross a limit that has not been crossed before.
        const double reached =
            Range{from < lower ? -kInfinity : lower, from > upper ? kInfinity : upper}.limit(next);
        pace_ = (reached - from) / h;
        return reached;
    }

    double step() const { return boundedStep(dt(), period()); }
    double periodOf() const { return std::max(1e-9 * static_cast<double>(period()), step()); }

    // Range of the velocity of a command at a place. Where limits disagree, braking before lower
    // and upper comes first, then the acceleration, then soft limits and max_velocity.
    Range velocities(Range x) const {
        const double change = deceleration * step();
        const Range reachable{pace_ - change, pace_ + change};
        const Range wanted = softened(x);
        const Range braking = brakingRange(x, pace_);
        return {braking.limit(reachable.limit(wanted.low)),
                braking.limit(reachable.limit(wanted.high))};
    }

    // Range of the velocity within the braking distances before lower and upper.
    // @param pace velocity of the last command
    Range brakingRange(Range x, double pace) const {
        return {-towards(x.low - lower, -pace), towards(upper - x.high, pace)};
    }

    // Largest velocity towards a limit.
    // @param distance to the limit; negative beyond it
    // @param pace     velocity of the last command towards it
    double towards(double distance, double pace) const {
        const double h = periodOf();
        const double allowed = brakingVelocity(std::max(distance, 0.0), deceleration, h);
        const double slower = pace - deceleration * h;
        if (slower <= allowed) return allowed;
        // Too fast, e.g. after a change of the limit. Beyond it, brakes by `deceleration`, before
        // it by as much as is needed.
        if (distance <= 0.0) return slower;
        return std::max(allowed, pace - 0.5 * pace * pace * h / distance);
    }

    // Range of the velocity within max_velocity and the soft limits.
    Range softened(Range x) const {
        const double h = periodOf();
        // A larger factor would cross the soft limit in one period.
        const double factor = std::min(k_position.value(), 1.0 / h);
        const auto towardsSoft = [&](double limit, double from) {
            const double distance = limit - from;
            if (std::isinf(limit)) return limit;
            // Slows down by at most `deceleration`: proportional near the limit, before it along
            // the braking parabola that continues this line.
            const double line = deceleration / (factor * factor);
            const double size = std::abs(distance);
            const double speed =
                size <= line ? factor * size : std::sqrt(deceleration * (2.0 * size - line));
            return std::copysign(speed, distance);
        };
        const Range fastest{-max_velocity, max_velocity};
        return {fastest.limit(towardsSoft(soft_lower, x.low)),
                fastest.limit(towardsSoft(soft_upper, x.high))};
    }

    // Range of the effort: it drives the velocity back into its range.
    Range efforts(Range x, double v) const {
        const double largest = max_effort;
        if (k_velocity == 0.0) return {-largest, largest};
        const Range wanted = softened(x);
        const Range braking = brakingRange(x, 0.0);
        return {std::clamp(-k_velocity * (v - braking.limit(wanted.low)), -largest, largest),
                std::clamp(-k_velocity * (v - braking.limit(wanted.high)), -largest, largest)};
    }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::JointLimiter, "JointLimiter",
                     "Limits a position, velocity or effort command by position, velocity, effort, "
                     "soft limits (as joint_limits_interface of ros_control) and braking distance",
                     JointLimiter)
