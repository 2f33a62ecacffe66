// Built with containers of another size than the executor's; see CMakeLists.txt.
#include <rtcf/component.hpp>

namespace {

class Stranger final : public rtcf::Component {
    void update() override {}
};

}  // namespace

RTCF_COMPONENT(Stranger, "Must not be used")
