#include <algorithm>
#include <cmath>

#include <rtcf/component.hpp>

namespace rtcf_control {
namespace {

class Backlash final : public rtcf::Component {
    rtcf::Input<double> in{this, "in"};
    rtcf::Output<double> out{this, "out", "", rtcf::Finite()};

    rtcf::Parameter<double> width{this, "width", 0.0, rtcf::Min(0.0),
                                  rtcf::Doc("play from flank to flank, in the unit of the input")};

    rtcf::State<double> position_{this, "position", 0.0, rtcf::Doc("position of the driven side")};
    rtcf::State<bool> begun_{this, "begun", false, rtcf::Doc("the first value has come")};

    bool start() override {
        begun_ = false;
        return true;
    }

    void update() override {
        if (in.read() == rtcf::DataStatus::None) return;
        const double drive = in.value();
        if (!std::isfinite(drive)) {
            out.write(drive);  // rejected as not finite: readers keep the last output
            return;
        }
        const double before = begun_ ? position_.value() : drive;
        position_ = std::clamp(before, drive - width / 2.0, drive + width / 2.0);
        begun_ = true;
        out.write(position_);
    }

    // Runs in the last cycle, too, to pass on the safe command of an upstream component.
    void safe() noexcept override { update(); }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::Backlash, "Backlash",
                     "Mechanical play: the play operator (Brokate & Sprekels, Hysteresis and Phase "
                     "Transitions, 1996)",
                     Backlash)
