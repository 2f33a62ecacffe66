#include <algorithm>
#include <cmath>
#include <limits>

#include <rtcf/component.hpp>

namespace rtcf_control {
namespace {

enum class Method { Euler, Trapezoid };

// The output is `initial` from the first cycle on, also without an input, so that a loop can be
// closed over integrators.
class Integrator final : public rtcf::Component {
    static constexpr double kInfinity = std::numeric_limits<double>::infinity();

    rtcf::Input<double> in{this, "in"};
    rtcf::Input<bool> reset{this, "reset"};
    rtcf::Output<double> out{this, "out", "", rtcf::Finite()};

    rtcf::Parameter<double> gain{this, "gain", 1.0, rtcf::Unit("1/s"),
                                 rtcf::Doc("factor of the input")};
    rtcf::Parameter<double> initial{this, "initial", 0.0,
                                    rtcf::Doc("output at the start and while reset is true")};
    rtcf::Parameter<double> lower{this, "lower", -kInfinity, rtcf::Doc("lower limit")};
    rtcf::Parameter<double> upper{this, "upper", kInfinity, rtcf::Doc("upper limit")};
    rtcf::Parameter<Method> method{this,
                                   "method",
                                   Method::Trapezoid,
                                   rtcf::Choice("euler", Method::Euler),
                                   rtcf::Choice("trapezoid", Method::Trapezoid),
                                   rtcf::Doc("backward Euler or trapezoidal rule")};

    rtcf::State<double> sum_{this, "sum", 0.0, rtcf::Doc("the integral")};
    rtcf::State<double> last_{this, "last", 0.0, rtcf::Doc("gain times the last input")};
    rtcf::State<bool> begun_{this, "begun", false, rtcf::Doc("the first value has come")};

    bool prepare(const rtcf::Values& proposed) override {
        if (proposed[lower] <= proposed[upper]) return true;
        return RTCF_FAIL(this, "lower = {} is above upper = {}", proposed[lower], proposed[upper]);
    }

    bool start() override {
        sum_ = initial.value();
        begun_ = false;
        return true;
    }

    void update() override {
        const bool has_value = in.read() != rtcf::DataStatus::None;
        const bool is_reset = reset.read() != rtcf::DataStatus::None && reset.value();
        const double rate = gain * in.value();
        if (has_value && !is_reset && !std::isfinite(rate)) {
            out.write(rate);  // rejected as not finite: readers keep the last output
            return;
        }
        if (is_reset || !begun_) {
            sum_ = initial.value();
        } else {
            sum_ += dt() * (method == Method::Euler ? rate : last_ / 2.0 + rate / 2.0);
        }
        sum_ = std::clamp(sum_.value(), lower.value(), upper.value());
        // The first value, and the first one after a reset, begin an interval.
        begun_ = has_value && std::isfinite(rate);
        if (begun_) last_ = rate;
        out.write(sum_);
    }

    // Runs in the last cycle, too, to pass on the safe command of an upstream component.
    void safe() noexcept override { update(); }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::Integrator, "Integrator",
                     "Integral over time within limits, with a reset", Integrator)
