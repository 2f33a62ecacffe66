#include <algorithm>
#include <cmath>
#include <limits>

#include <rtcf/component.hpp>

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
        rtcf::Doc("deceleration for the braking distance before lower and upper")};
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
        rtcf::Doc("effort by excess velocity; 0 = no effort towards excess velocity")};

    rtcf::State<double> last_{this, "last", 0.0, rtcf::Doc("the last output")};
    rtcf::State<bool> begun_{this, "begun", false, rtcf::Doc("the last output is valid")};

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
        return true;
    }

    bool start() override {
        begun_ = false;
        return true;
    }

    void update() override {
        const bool has_position = position.read() != rtcf::DataStatus::None;
        velocity.read();
        if (in.read() == rtcf::DataStatus::None) return;
        const double wanted = in.value();
        switch (command.value()) {
            case Command::Position:
                // Begins at the measured position, so that the joint does not jump.
                if (!begun_ && has_position && !std::isfinite(position.value())) {
                    out.write(position.value());  // rejected as not finite
                    return;
                }
                if (begun_) {
                    write(wanted, followed(wanted, last_));
                } else {
                    write(wanted,
                          followed(wanted, has_position ? position.value()
                                                        : Range{lower, upper}.limit(wanted)));
                }
                return;
            case Command::Velocity:
                if (!usable(position, needsPosition())) return;
                write(wanted, velocities(position.value()).limit(wanted));
                return;
            case Command::Effort:
                if (!usable(position, needsPosition()) || !usable(velocity, needsVelocity()))
                    return;
                write(wanted, efforts(position.value(), velocity.value()).limit(wanted));
                return;
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

    // False without a value that is needed. A value that is not finite is reported as a fault.
    bool usable(const rtcf::Input<double>& measured, bool needed) {
        if (std::isfinite(measured.value())) return !needed || measured.hasValue();
        out.write(measured.value());  // rejected as not finite: readers keep the last output
        return false;
    }

    void write(double wanted, double value) {
        if (!std::isfinite(wanted)) {
            out.write(wanted);  // rejected, as above
            return;
        }
        out.write(value);
        limited.write(value != wanted);
        last_ = value;
        begun_ = true;
    }

    // Position of this cycle on the way from the last one.
    double followed(double wanted, double from) const {
        const Range allowed = velocities(from);
        const double target = Range{lower, upper}.limit(wanted);
        const double step = Range{allowed.low * dt(), allowed.high * dt()}.limit(target - from);
        // Exactly there if only rounding is left.
        const double rest = std::abs(target - from - step);
        const double next = rest <= 1e-12 * std::abs(target - from) ? target : from + step;
        // Rounding must not cross a limit that has not been crossed before.
        return Range{std::min(lower.value(), from), std::max(upper.value(), from)}.limit(next);
    }

    // Range of the velocity at a position. Braking comes before soft limits, where both disagree.
    Range velocities(double x) const {
        const double period_s = std::max(1e-9 * static_cast<double>(period()), dt());
        const double up = brakingVelocity(std::max(upper - x, 0.0), deceleration, period_s);
        const double down = brakingVelocity(std::max(x - lower, 0.0), deceleration, period_s);
        // A larger factor would cross the soft limit in one period.
        const double factor = std::min(k_position.value(), 1.0 / period_s);
        const Range braking{-down, up};
        const Range fastest{-max_velocity, max_velocity};
        const auto softened = [&](double limit) {
            return fastest.limit(braking.limit(std::isinf(limit) ? limit : factor * (limit - x)));
        };
        return {softened(soft_lower), softened(soft_upper)};
    }

    // Range of the effort: it drives the velocity back into its range.
    Range efforts(double x, double v) const {
        const Range allowed = velocities(x);
        const double largest = max_effort;
        if (k_velocity == 0.0)
            return {v <= allowed.low ? 0.0 : -largest, v >= allowed.high ? 0.0 : largest};
        return {std::clamp(-k_velocity * (v - allowed.low), -largest, largest),
                std::clamp(-k_velocity * (v - allowed.high), -largest, largest)};
    }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::JointLimiter, "JointLimiter",
                     "Limits a position, velocity or effort command by position, velocity, effort, "
                     "soft limits (as joint_limits_interface of ros_control) and braking distance",
                     JointLimiter)
