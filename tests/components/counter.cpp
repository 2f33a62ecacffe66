// Counts its cycles: tells whether the loop has missed one, and whether a
// change elsewhere has touched this component.
#include <cstdint>

#include <rtcf/component.hpp>

namespace {

class Counter final : public rtcf::Component {
    rtcf::Input<std::int32_t> in{this, "in"};
    rtcf::Output<std::int32_t> out{this, "out"};
    std::int32_t count_ = 0;

    void update() override {
        in.read();
        out.write(++count_);
    }
};

}  // namespace

RTCF_COMPONENT(Counter, "Counts its cycles")
