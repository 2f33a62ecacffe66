// As components/rtcf_examples/python/pid.py.
#include <algorithm>
#include <cmath>
#include <rtcf/component.hpp>

namespace {

class Pid final : public rtcf::Component {
    rtcf::Input<double> setpoint{this, "setpoint"};
    rtcf::Input<double> measured{this, "measured"};
    rtcf::Output<double> effort{this, "effort", "", rtcf::Finite()};
    rtcf::Parameter<double> kp{this, "kp", 2.0, rtcf::Min(0.0)};
    rtcf::Parameter<double> ti{this, "ti", 0.5, rtcf::Min(1e-3), rtcf::Unit("s")};
    rtcf::Parameter<double> td{this, "td", 0.05, rtcf::Min(0.0), rtcf::Unit("s")};
    rtcf::Parameter<double> n{this, "n", 10.0, rtcf::Min(1.0), rtcf::Max(100.0)};
    rtcf::Parameter<double> limit{this, "limit", 10.0, rtcf::Min(0.0)};
    rtcf::State<double> integral{this, "integral", 0.0};
    rtcf::State<double> derivative{this, "derivative", 0.0};
    rtcf::State<double> last{this, "last", 0.0};
    rtcf::State<bool> has_last{this, "has_last", false};

    void update() override {
        const bool is_led = setpoint.read() != rtcf::DataStatus::None;
        const bool is_measured = measured.read() != rtcf::DataStatus::None;
        if (!is_led || !is_measured) return;
        const double y = measured.value();
        const double error = setpoint.value() - y;
        const double slope = has_last ? y - last : 0.0;
        last = y;
        has_last = true;

        const double filter_time = td / n;
        derivative = (filter_time * derivative - kp * td * slope) / (filter_time + dt());
        const double wanted = kp * error + integral + derivative;
        const double limited = std::clamp(wanted, -limit.value(), limit.value());
        const double tracking = td > 0.0 ? std::sqrt(ti * td) : ti.value();
        integral += dt() * (kp / ti * error + (limited - wanted) / tracking);
        effort.write(limited);
    }
};
RTCF_COMPONENT(Pid, "Drives a measured value to a set point")

}  // namespace
