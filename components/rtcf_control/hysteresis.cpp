#include <rtcf/component.hpp>

namespace rtcf_control {
namespace {

class Hysteresis final : public rtcf::Component {
    rtcf::Input<double> in{this, "in"};
    rtcf::Output<bool> out{this, "out"};

    rtcf::Parameter<double> low{this, "low", 0.0, rtcf::Doc("false below this value")};
    rtcf::Parameter<double> high{this, "high", 0.0, rtcf::Doc("true above this value")};

    rtcf::Parameter<bool> initial{
        this, "initial", false, rtcf::Doc("output at the start, until the input leaves the band")};

    rtcf::State<bool> on_{this, "on", false, rtcf::Doc("the output")};
    rtcf::State<bool> begun_{this, "begun", false, rtcf::Doc("the first value has come")};

    bool prepare(const rtcf::Values& proposed) override {
        if (proposed[low] <= proposed[high]) return true;
        return RTCF_FAIL(this, "low = {} is above high = {}", proposed[low], proposed[high]);
    }

    bool start() override {
        begun_ = false;
        return true;
    }

    void update() override {
        if (in.read() == rtcf::DataStatus::None) return;
        if (!begun_) on_ = initial.value();
        begun_ = true;
        // NaN is neither above nor below: the output stays.
        if (in.value() > high) {
            on_ = true;
        } else if (in.value() < low) {
            on_ = false;
        }
        out.write(on_);
    }

    // Runs in the last cycle, too, to pass on the safe command of an upstream component.
    void safe() noexcept override { update(); }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::Hysteresis, "Hysteresis",
                     "Schmitt trigger: true above high, false below low, else unchanged",
                     Hysteresis)
