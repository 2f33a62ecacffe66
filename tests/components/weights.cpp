// A bounded vector of parameters: the output is a weighted sum of the last inputs.
#include <array>
#include <cstddef>

#include "rtcf/component.hpp"

namespace {

class Weights final : public rtcf::Component {
    static constexpr std::size_t kMost = 8;
    rtcf::Input<double> u{this, "u"};
    rtcf::Output<double> y{this, "y"};
    rtcf::Output<double> sum{this, "sum"};
    rtcf::Output<int> count{this, "count"};

    rtcf::Parameter<rtcf::BoundedVector<double, kMost>> taps{
        this, "filter/taps", {0.5, 0.25, 0.25}, rtcf::Min(-10.0), rtcf::Unit("1")};
    std::array<double, kMost> past{};

    bool prepare(const rtcf::Values& proposed) override {
        return !proposed[taps].empty() || fail("filter/taps has no element");
    }
    void update() override {
        u.read();
        for (std::size_t i = kMost - 1; i > 0; --i) past[i] = past[i - 1];
        past[0] = u.value();
        double weighted = 0.0;
        double total = 0.0;
        for (std::size_t i = 0; i < taps.size(); ++i) weighted += taps[i] * past[i];
        for (const double tap : taps) total += tap;
        y.write(weighted);
        sum.write(total);
        count.write(static_cast<int>(taps.size()));
    }
};

}  // namespace

RTCF_COMPONENT(Weights, "A weighted sum of the last inputs")
