// Parameters in groups, one of them an array.
#include <array>

#include "rtcf/component.hpp"

namespace {

class Grouped final : public rtcf::Component {
    rtcf::Output<double> sum{this, "sum"};

    rtcf::Parameter<double> p{this, "gains/p", 1.0, rtcf::Min(0.0), rtcf::Max(100.0)};
    rtcf::Parameter<int> order{this, "gains/filter/order", 2, rtcf::Min(1.0), rtcf::Max(9.0)};
    rtcf::Parameter<std::array<double, 3>> k{this, "gains/k", {0.25, 0.5, 0.125}};
    rtcf::Parameter<double> offset{this, "offset", 10.0};

    void update() override { sum.write(offset + p + order.value() + k[0] + k[1] + k[2]); }
};

}  // namespace

RTCF_COMPONENT(Grouped, "Parameters in groups")
