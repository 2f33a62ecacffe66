// A component whose source was written in Latin-1: its texts are not UTF-8. Its parameters select
// the hook that logs, fails or throws.
#include <stdexcept>
#include <string>
#include <string_view>

#include <rtcf/component.hpp>

namespace {

constexpr const char* kText = "Stromst\xE4rke";

class Latin1 final : public rtcf::Component {
    bool prepare(const rtcf::Values& proposed) override {
        return acts("prepare", proposed[hook_], proposed[act_]);
    }
    bool configure() override { return acts("configure", hook_, act_); }
    bool start() override { return acts("start", hook_, act_); }
    void stop() override { (void)acts("stop", hook_, act_); }
    void update() override {
        if (iteration() == kQuiet) (void)acts("update", hook_, act_);
    }

    bool acts(std::string_view hook, const std::string& chosen, const std::string& act) {
        if (chosen != hook) return true;
        if (act == "throw") throw std::runtime_error(kText);
        if (act == "fail") return fail("{} is wrong", kText);
        RTCF_WARN(this, "Stromst\xE4rke in {}: {}", hook, kText);
        return true;
    }

    static constexpr std::uint64_t kQuiet = 20;  // cycles before update() acts
    rtcf::Parameter<std::string> hook_{this, "hook", ""};
    rtcf::Parameter<std::string> act_{this, "act", "log", rtcf::Doc("log, fail or throw")};
};

}  // namespace

RTCF_COMPONENT(Latin1, "Has texts in Latin-1")
