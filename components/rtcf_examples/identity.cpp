// A minimal component: one input, one output.
#include <std_msgs/Float64.h>

#include <rtcf/component.hpp>

namespace {

class Identity final : public rtcf::Component {
    rtcf::Input<std_msgs::Float64> in{this, "in"};
    rtcf::Output<std_msgs::Float64> out{this, "out"};

    void update() override {
        if (in.read() == rtcf::DataStatus::New) out.write(in.value());
    }
};

}  // namespace

RTCF_COMPONENT(Identity, "Passes each new value on")
