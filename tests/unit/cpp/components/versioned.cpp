// Built twice, with different VERSIONs: the same type before and after a rebuild.
#include <rtcf/component.hpp>

namespace {

class Versioned final : public rtcf::Component {
    rtcf::Output<std::int32_t> out{this, "out"};
    void update() override { out.write(VERSION); }
};

}  // namespace

RTCF_COMPONENT(Versioned, "Writes its VERSION")
