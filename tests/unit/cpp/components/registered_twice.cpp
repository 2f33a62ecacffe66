// Two classes under one name, as of two source files.
#include <rtcf/component.hpp>

namespace {

class First final : public rtcf::Component {
    void update() override {}
};
class Second final : public rtcf::Component {
    void update() override {}
};

}  // namespace

RTCF_COMPONENT_NAMED(First, "Gain", "of file 1", first)
RTCF_COMPONENT_NAMED(Second, "Gain", "of file 2", second)
