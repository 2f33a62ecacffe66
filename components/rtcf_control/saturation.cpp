#include <algorithm>
#include <cmath>
#include <limits>

#include <rtcf/component.hpp>

namespace rtcf_control {
namespace {

class Saturation final : public rtcf::Component {
    static constexpr double kInfinity = std::numeric_limits<double>::infinity();

    rtcf::Input<double> in{this, "in"};
    rtcf::Output<double> out{this, "out", "", rtcf::Finite()};
    rtcf::Output<bool> saturated{this, "saturated"};

    rtcf::Parameter<double> lower{this, "lower", -kInfinity, rtcf::Doc("lower limit")};
    rtcf::Parameter<double> upper{this, "upper", kInfinity, rtcf::Doc("upper limit")};

    bool prepare(const rtcf::Values& proposed) override {
        if (proposed[lower] <= proposed[upper]) return true;
        return RTCF_FAIL(this, "lower = {} is above upper = {}", proposed[lower], proposed[upper]);
    }

    void update() override {
        if (in.read() == rtcf::DataStatus::None) return;
        const double value = in.value();
        if (!std::isfinite(value)) {
            out.write(value);  // rejected as not finite: readers keep the last output
            return;
        }
        const double limited = std::clamp(value, lower.value(), upper.value());
        out.write(limited);
        saturated.write(limited != value);
    }

    // Runs in the last cycle, too, to pass on the safe command of an upstream component.
    void safe() noexcept override { update(); }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::Saturation, "Saturation", "Limits a value to a range",
                     Saturation)
