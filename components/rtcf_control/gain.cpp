#include <rtcf/component.hpp>

namespace rtcf_control {
namespace {

class Gain final : public rtcf::Component {
    rtcf::Input<double> in{this, "in"};
    rtcf::Output<double> out{this, "out", "", rtcf::Finite()};

    rtcf::Parameter<double> gain{this, "gain", 1.0, rtcf::Doc("factor")};
    rtcf::Parameter<double> offset{this, "offset", 0.0, rtcf::Doc("added to the product")};

    void update() override {
        if (in.read() == rtcf::DataStatus::None) return;
        out.write(gain * in.value() + offset);
    }

    // Runs in the last cycle, too, to pass on the safe command of an upstream component.
    void safe() noexcept override { update(); }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::Gain, "Gain",
                     "Multiplies by a gain and adds an offset: out = gain * in + offset", Gain)
