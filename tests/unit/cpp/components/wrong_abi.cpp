// Claims to be built with headers of another ABI.
#include <rtcf/version.hpp>
#undef RTCF_ABI_VERSION
#define RTCF_ABI_VERSION 4711u
#include <rtcf/component.hpp>

namespace {

class Stranger final : public rtcf::Component {
    void update() override {}
};

}  // namespace

RTCF_COMPONENT(Stranger, "Must not be used")
