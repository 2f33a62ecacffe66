// As components/rtcf_examples/python/s_curve.py.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <rtcf/component.hpp>

namespace {

enum class Phase : std::int64_t { Rest, Moving, Settling };

class SCurve final : public rtcf::Component {
    rtcf::Input<double> target{this, "target"};
    rtcf::Output<double> position{this, "position"};
    rtcf::Output<double> velocity{this, "velocity"};
    rtcf::Output<double> acceleration{this, "acceleration"};
    rtcf::Output<std::int64_t> phase{this, "phase"};
    rtcf::Parameter<double> max_velocity{this, "max_velocity", 1.0, rtcf::Min(1e-3)};
    rtcf::Parameter<double> max_acceleration{this, "max_acceleration", 5.0, rtcf::Min(1e-3)};
    rtcf::Parameter<double> max_jerk{this, "max_jerk", 50.0, rtcf::Min(1e-3)};
    rtcf::State<double> x{this, "x", 0.0};
    rtcf::State<double> v{this, "v", 0.0};
    rtcf::State<double> a{this, "a", 0.0};
    rtcf::State<Phase> mode{this, "mode", Phase::Rest};

    bool moving() const { return std::abs(v) > 1e-6 || std::abs(a) > 1e-4; }

    // The highest velocity from which it can still stop at the target.
    double wantedVelocity(double distance) const {
        const double ramp = max_acceleration * max_acceleration / max_jerk;
        const double speed =
            std::sqrt(ramp * ramp / 4.0 + 2.0 * max_acceleration * std::abs(distance)) - ramp / 2.0;
        return std::copysign(std::min(std::max(speed, 0.0), max_velocity.value()), distance);
    }

    void update() override {
        if (target.read() == rtcf::DataStatus::None) return;
        const double distance = target.value() - x;
        switch (mode.value()) {
            case Phase::Rest:
                if (std::abs(distance) > 1e-6) mode = Phase::Moving;
                break;
            case Phase::Moving:
                if (std::abs(distance) < 1e-4) mode = Phase::Settling;
                break;
            case Phase::Settling:
                if (!moving())
                    mode = Phase::Rest;
                else if (std::abs(distance) > 1e-3)
                    mode = Phase::Moving;
                break;
        }

        if (mode.value() == Phase::Rest) {
            v = 0.0;
            a = 0.0;
        } else {
            const double error = wantedVelocity(distance) - v;
            const double size = std::sqrt(2.0 * max_jerk * std::abs(error)) / 1.5;
            const double wanted = std::clamp(std::copysign(size, error), -max_acceleration.value(),
                                             max_acceleration.value());
            const double step = max_jerk * dt();
            a += std::clamp(wanted - a, -step, step);
            v += a * dt();
            x += v * dt();
        }
        position.write(x);
        velocity.write(v);
        acceleration.write(a);
        phase.write(static_cast<std::int64_t>(mode.value()));
    }
};
RTCF_COMPONENT(SCurve, "Follows a target without exceeding its limits")

}  // namespace
