// An array parameter: the output is a polynomial of the input.
#include <array>

#include "rtcf/component.hpp"

namespace {

class Polynomial final : public rtcf::Component {
    rtcf::Input<double> x{this, "x"};
    rtcf::Output<double> y{this, "y"};
    rtcf::Output<double> sum{this, "sum"};

    rtcf::Parameter<std::array<double, 3>> coefficients{
        this, "coefficients", {1.0, 0.0, 0.0}, rtcf::Max(100.0), rtcf::Unit("m")};

    bool prepare(const rtcf::Values& proposed) override {
        const std::array<double, 3> next = proposed[coefficients];
        return next[2] >= 0.0 || fail("coefficients_2 = {} bends down", next[2]);
    }
    void update() override {
        x.read();
        const double at = x.value();
        y.write(coefficients[0] + at * (coefficients[1] + at * coefficients[2]));
        sum.write(coefficients[0] + coefficients[1] + coefficients[2]);
    }
};

}  // namespace

RTCF_COMPONENT(Polynomial, "A polynomial of the second degree")
