#include <algorithm>
#include <cmath>

#include <rtcf/component.hpp>

namespace rtcf_control {
namespace {

class DeadBand final : public rtcf::Component {
    rtcf::Input<double> in{this, "in"};
    rtcf::Output<double> out{this, "out", "", rtcf::Finite()};

    rtcf::Parameter<double> lower{this, "lower", 0.0, rtcf::Doc("lower end of the band")};
    rtcf::Parameter<double> upper{this, "upper", 0.0, rtcf::Doc("upper end of the band")};

    bool prepare(const rtcf::Values& proposed) override {
        if (proposed[lower] <= proposed[upper]) return true;
        return RTCF_FAIL(this, "lower = {} is above upper = {}", proposed[lower], proposed[upper]);
    }

    void update() override {
        if (in.read() == rtcf::DataStatus::None) return;
        const double value = in.value();
        // A value that is not finite is rejected: readers keep the last output.
        out.write(std::isfinite(value) ? value - std::clamp(value, lower.value(), upper.value())
                                       : value);
    }

    // Runs in the last cycle, too, to pass on the safe command of an upstream component.
    void safe() noexcept override { update(); }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::DeadBand, "DeadBand",
                     "0 within a band, else the distance to the nearer end of the band", DeadBand)
