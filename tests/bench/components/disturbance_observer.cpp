// As components/rtcf_examples/python/disturbance_observer.py.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <rtcf/component.hpp>

namespace {

class DisturbanceObserver final : public rtcf::Component {
    rtcf::Parameter<double> inertia{this, "inertia", 0.02, rtcf::Min(1e-6), rtcf::Unit("kg m^2")};
    rtcf::Parameter<double> bandwidth{this,           "bandwidth",       200.0,
                                      rtcf::Min(1.0), rtcf::Max(2000.0), rtcf::Unit("rad/s")};
    rtcf::Input<double> command{this, "command"};
    rtcf::Input<double> velocity{this, "velocity"};
    rtcf::Output<double> disturbance{this, "disturbance", "N m"};
    rtcf::Output<double> compensated{this, "compensated", "N m"};
    rtcf::Output<bool> contact{this, "contact"};
    rtcf::Parameter<double> threshold{this, "threshold", 0.5, rtcf::Min(0.0), rtcf::Unit("N m")};
    rtcf::Parameter<double> limit{this, "limit", 5.0, rtcf::Min(0.0), rtcf::Unit("N m")};
    rtcf::State<double> z{this, "z", 0.0};
    rtcf::State<double> estimate{this, "estimate", 0.0};
    rtcf::State<std::int64_t> beyond{this, "beyond", 0};

    double filtered(double value, double target) const {
        const double share = 1.0 - std::exp(-bandwidth * dt());
        return value + share * (target - value);
    }

    void update() override {
        const bool is_commanded = command.read() != rtcf::DataStatus::None;
        velocity.read();
        const double momentum = bandwidth * inertia * velocity.value();
        const double input = is_commanded ? command.value() : 0.0;
        z = filtered(z, input + momentum);
        estimate = std::clamp(z - momentum, -limit.value(), limit.value());
        beyond = std::abs(estimate) > threshold ? beyond + 1 : 0;
        disturbance.write(estimate);
        compensated.write(command.value() + estimate);
        contact.write(beyond >= 5);
    }
};
RTCF_COMPONENT(DisturbanceObserver, "Compensates for disturbances of a drive")

}  // namespace
