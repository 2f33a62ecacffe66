// A parameter of each type, with bounds; its outputs show the values.
#include <cstdint>
#include <string>

#include <rtcf/component.hpp>

namespace {

enum class Mode { Idle, Run };

class Knobs final : public rtcf::Component {
    rtcf::Output<double> product{this, "product"};
    rtcf::Output<std::int32_t> length{this, "length"};

    rtcf::Parameter<bool> enabled{this, "enabled", true, rtcf::Doc("0 at the output without it")};
    rtcf::Parameter<std::int32_t> count{this, "count", 2, rtcf::Min(0), rtcf::Max(10)};
    rtcf::Parameter<double> rate{this,           "rate",           1.5, rtcf::Min(-1.0),
                                 rtcf::Max(1e3), rtcf::Unit("m/s")};
    rtcf::Parameter<std::string> label{this, "label", "abc", rtcf::Doc("its length is an output")};
    rtcf::Parameter<Mode> mode{this, "mode", Mode::Run, rtcf::Choice("idle", Mode::Idle),
                               rtcf::Choice("run", Mode::Run)};

    void update() override {
        const bool active = enabled && mode == Mode::Run;
        product.write(active ? static_cast<double>(count) * rate : 0.0);
        length.write(static_cast<std::int32_t>(label.value().size()));
    }
};

}  // namespace

RTCF_COMPONENT(Knobs, "A parameter of each type")
