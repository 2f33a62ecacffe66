// Calls an undefined function.
#include <rtcf/component.hpp>

extern "C" void rtcf_unit_test_undefined_function();

namespace {

class Incomplete final : public rtcf::Component {
    void update() override { rtcf_unit_test_undefined_function(); }
};

}  // namespace

RTCF_COMPONENT(Incomplete, "Cannot be linked")
