#include <rtcf/component.hpp>

namespace rtcf_control {
namespace {

class Sum final : public rtcf::Component {
    rtcf::Input<double> in1{this, "in1"};
    rtcf::Input<double> in2{this, "in2"};
    rtcf::Input<double> in3{this, "in3"};
    rtcf::Input<double> in4{this, "in4"};
    rtcf::Output<double> out{this, "out", "", rtcf::Finite()};

    rtcf::Parameter<double> gain1{this, "gain1", 1.0, rtcf::Doc("factor of in1; -1 subtracts")};
    rtcf::Parameter<double> gain2{this, "gain2", 1.0, rtcf::Doc("factor of in2; -1 subtracts")};
    rtcf::Parameter<double> gain3{this, "gain3", 1.0, rtcf::Doc("factor of in3; -1 subtracts")};
    rtcf::Parameter<double> gain4{this, "gain4", 1.0, rtcf::Doc("factor of in4; -1 subtracts")};
    rtcf::Parameter<double> bias{this, "bias", 0.0, rtcf::Doc("added to the sum")};

    void update() override {
        double sum = bias;
        bool has_value = false;
        const auto add = [&](rtcf::Input<double>& in, double gain) {
            if (in.read() == rtcf::DataStatus::None) return;
            sum += gain * in.value();
            has_value = true;
        };
        add(in1, gain1);
        add(in2, gain2);
        add(in3, gain3);
        add(in4, gain4);
        if (has_value) out.write(sum);
    }

    // Runs in the last cycle, too, to pass on the safe command of an upstream component.
    void safe() noexcept override { update(); }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::Sum, "Sum",
                     "Weighted sum of up to four inputs; an input without a value counts as 0", Sum)
