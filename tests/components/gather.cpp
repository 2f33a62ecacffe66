// The most inputs that a component can have in a graph of five components.
#include <cstdint>

#include <rtcf/component.hpp>

namespace {

class Gather final : public rtcf::Component {
    rtcf::Input<std::int32_t> in1{this, "in1"};
    rtcf::Input<std::int32_t> in2{this, "in2"};
    rtcf::Input<std::int32_t> in3{this, "in3"};
    rtcf::Input<std::int32_t> in4{this, "in4"};
    rtcf::Input<std::int32_t> in5{this, "in5"};
    rtcf::Output<std::int32_t> out{this, "out"};

    void update() override {
        std::int32_t newest = 0;
        for (auto* input : {&in1, &in2, &in3, &in4, &in5})
            newest += input->read() == rtcf::DataStatus::New ? 1 : 0;
        out.write(newest);
    }
};

}  // namespace

RTCF_COMPONENT(Gather, "Counts its inputs with new values")
