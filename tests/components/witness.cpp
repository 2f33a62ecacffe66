// Says in the log which hook is called.
#include <rtcf/component.hpp>

namespace {

class Witness final : public rtcf::Component {
    bool configure() override {
        RTCF_INFO(this, "hook {}", "configure");
        return true;
    }
    bool start() override {
        RTCF_INFO(this, "hook {}", "start");
        return true;
    }
    void update() override { RTCF_INFO_ONCE(this, "hook {}", "update"); }
    void safe() noexcept override { RTCF_INFO(this, "hook {}", "safe"); }
    void stop() override { RTCF_INFO(this, "hook {}", "stop"); }
    void cleanup() override { RTCF_INFO(this, "hook {}", "cleanup"); }
};

}  // namespace

RTCF_COMPONENT(Witness, "Logs each hook")
