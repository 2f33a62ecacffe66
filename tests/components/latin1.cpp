// A component that describes itself in Latin-1, in each text that it declares.
#include <string>

#include <rtcf/component.hpp>

namespace {

class Thermometer final : public rtcf::Component {
    rtcf::Output<double> out_{this, "out", "\xB0\x43"};
    rtcf::Parameter<std::string> place_{this, "place", "K\xFC\x63he", rtcf::Unit("\xB0"),
                                        rtcf::Doc("gew\xF6hnlich")};
    rtcf::State<double> heat_{this, "heat", 0.0, rtcf::Unit("\xB0\x43"), rtcf::Doc("W\xE4rme")};

    void update() override {
        heat_ += 1.0;
        out_.write(heat_);
    }
};

}  // namespace

RTCF_COMPONENT(Thermometer, "Misst in \xB0\x43")
