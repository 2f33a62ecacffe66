#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <rtcf/component.hpp>

namespace rtcf_control {
namespace {

class Switch final : public rtcf::Component {
    rtcf::Input<double> in0{this, "in0"};
    rtcf::Input<double> in1{this, "in1"};
    rtcf::Input<double> in2{this, "in2"};
    rtcf::Input<double> in3{this, "in3"};
    rtcf::Input<std::int32_t> select{this, "select"};
    rtcf::Output<double> out{this, "out", "", rtcf::Finite()};

    rtcf::Parameter<std::int32_t> selected{
        this,           "selected",     0,
        rtcf::Min(0.0), rtcf::Max(3.0), rtcf::Doc("number of the input, until select has a value")};
    rtcf::Parameter<double> fade{this,
                                 "fade",
                                 0.0,
                                 rtcf::Min(0.0),
                                 rtcf::Unit("s"),
                                 rtcf::Doc("time of the transition to another input; 0 = at once")};

    rtcf::State<std::int32_t> active_{this, "active", -1, rtcf::Doc("number of the input"),
                                      rtcf::Live()};
    rtcf::State<double> last_{this, "last", 0.0, rtcf::Doc("the last output"), rtcf::Live()};
    rtcf::State<double> from_{this, "from", 0.0, rtcf::Doc("output before the change"),
                              rtcf::Live()};
    rtcf::State<double> share_{this, "share", 1.0, rtcf::Doc("share of the active input"),
                               rtcf::Live()};

    bool start() override {
        active_ = -1;
        return true;
    }

    void update() override {
        const std::array<rtcf::Input<double>*, 4> inputs{&in0, &in1, &in2, &in3};
        std::array<bool, 4> has_value{};
        for (std::size_t i = 0; i < inputs.size(); ++i)
            has_value[i] = inputs[i]->read() != rtcf::DataStatus::None;
        const auto selectable = [&](std::int32_t number) {
            return number >= 0 && number < 4 && has_value[static_cast<std::size_t>(number)];
        };
        // A number without an input, or of an input without a value, leaves the selection as it is.
        const std::int32_t wanted =
            select.read() != rtcf::DataStatus::None ? select.value() : selected.value();
        if (selectable(wanted) && wanted != active_) {
            from_ = last_.value();
            share_ = active_ < 0 || fade == 0.0 ? 1.0 : 0.0;
            active_ = wanted;
        }
        if (!selectable(active_)) return;
        const double value = inputs[static_cast<std::size_t>(active_.value())]->value();
        if (!std::isfinite(value)) {
            out.write(value);  // rejected as not finite: readers keep the last output
            return;
        }
        if (share_ < 1.0) share_ = fade > 0.0 ? std::min(1.0, share_ + dt() / fade) : 1.0;
        last_ = share_ * value + (1.0 - share_) * from_;
        out.write(last_);
    }

    // Runs in the last cycle, too, to pass on the safe command of an upstream component.
    void safe() noexcept override { update(); }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::Switch, "Switch",
                     "Selects one of four inputs, with a linear transition to another one", Switch)
