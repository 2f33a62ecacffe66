// Listing 1 of the paper, written with the API of rtcf.
#include <std_msgs/Float32.h>

#include <rtcf/component.hpp>

namespace {

class PaperExample final : public rtcf::Component {
    rtcf::Input<std_msgs::Float32> in_port{this, "in_port"};
    rtcf::Output<std_msgs::Float32> out_port{this, "out_port"};
    rtcf::Parameter<double> test_param{this, "test_param", 0.0,
                                       rtcf::Doc("logged when the loop starts")};

    bool start() override {
        RTCF_INFO(this, "test_param is {}", test_param.value());
        return true;
    }

    void update() override {
        RTCF_DEBUG(this, "update {}", iteration());
        in_port.read();
        out_port.write(in_port.value());
    }
};

}  // namespace

RTCF_COMPONENT(PaperExample, "Copies its input to its output and logs; Listing 1 of the paper")
