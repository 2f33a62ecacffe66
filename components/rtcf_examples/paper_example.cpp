// The paper's Listing 1 in this project's own API.
#include <std_msgs/Float32.h>

#include <rtcf/component.hpp>

namespace {

class PaperExample final : public rtcf::Component {
    rtcf::Input<std_msgs::Float32> in_port{this, "in_port"};
    rtcf::Output<std_msgs::Float32> out_port{this, "out_port"};
    rtcf::Parameter<double> test_param{this, "test_param", 0.0,
                                       rtcf::Doc("shown in the log at start")};

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

RTCF_COMPONENT(PaperExample, "Passes its input on and logs; Listing 1 of the paper")
