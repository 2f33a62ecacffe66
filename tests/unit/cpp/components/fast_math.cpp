// Linked with -ffast-math: loading it makes the processor flush subnormal numbers to zero.
#include <rtcf/component.hpp>

namespace {

class FastMath final : public rtcf::Component {
    void update() override {}
};

}  // namespace

RTCF_COMPONENT(FastMath, "Does nothing, fast")
