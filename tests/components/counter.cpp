// Counts its cycles, to detect a missed cycle, or a side effect of changes to other
// components.
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
