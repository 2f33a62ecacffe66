// The component of the paper's evaluation (section 3). It only adds numbers, so
// that a benchmark measures the framework and not the component.
#include <std_msgs/Float64.h>

#include <rtcf/component.hpp>

namespace {

class Mimo final : public rtcf::Component {
    using Number = std_msgs::Float64;

    rtcf::Input<Number> in1{this, "in1"};
    rtcf::Input<Number> in2{this, "in2"};
    rtcf::Input<Number> in3{this, "in3"};
    rtcf::Input<Number> in4{this, "in4"};
    rtcf::Output<Number> out1{this, "out1"};
    rtcf::Output<Number> out2{this, "out2"};

    void update() override {
        // Without new data in1 counts as 1, so that a loop of sums leaves 0.
        double sum = in1.read() == rtcf::DataStatus::New ? in1.value().data : 1.0;
        if (in2.read() == rtcf::DataStatus::New) sum += in2.value().data;
        if (in3.read() == rtcf::DataStatus::New) sum += in3.value().data;
        if (in4.read() == rtcf::DataStatus::New) sum += in4.value().data;
        if (sum > kLimit) sum = 1.0;
        Number out;
        out.data = sum;
        out1.write(out);
        out2.write(out);
    }

    // Sums in a loop grow without bound: restart at 1 above this value.
    static constexpr double kLimit = 1e20;
};

}  // namespace

RTCF_COMPONENT(Mimo, "Sums its inputs that have new data; the paper's benchmark")
