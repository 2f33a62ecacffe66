#include <cstdint>

#include <rtcf/component.hpp>

namespace rtcf_control {
namespace {

class Counter final : public rtcf::Component {
    rtcf::Input<bool> up{this, "up"};
    rtcf::Input<bool> down{this, "down"};
    rtcf::Input<bool> reset{this, "reset"};
    rtcf::Output<std::int64_t> count{this, "count"};

    rtcf::Parameter<std::int64_t> initial{this,
                                          "initial",
                                          0,
                                          rtcf::Min(-9e15),
                                          rtcf::Max(9e15),
                                          rtcf::Doc("count at the start and while reset is true")};
    rtcf::Parameter<std::int64_t> modulus{
        this,
        "modulus",
        0,
        rtcf::Min(0.0),
        rtcf::Max(9e15),
        rtcf::Doc("the count wraps around between 0 and modulus - 1; 0 = no limit")};

    rtcf::State<std::int64_t> count_{this, "count", 0, rtcf::Doc("the count")};
    rtcf::State<bool> begun_{this, "begun", false, rtcf::Doc("the first cycle has run")};
    rtcf::State<bool> was_up_{this, "was_up", true, rtcf::Doc("up in the last cycle")};
    rtcf::State<bool> was_down_{this, "was_down", true, rtcf::Doc("down in the last cycle")};

    bool start() override {
        begun_ = false;
        was_up_ = true;  // a level that is already high is no edge
        was_down_ = true;
        return true;
    }

    void update() override {
        if (!begun_) count_ = initial.value();
        begun_ = true;
        if (rises(up, was_up_)) count_ += 1;
        if (rises(down, was_down_)) count_ -= 1;
        if (reset.read() != rtcf::DataStatus::None && reset.value()) count_ = initial.value();
        if (modulus > 0) count_ = ((count_ % modulus) + modulus) % modulus;
        count.write(count_);
    }

    // Runs in the last cycle, too, to pass on the safe command of an upstream component.
    void safe() noexcept override { update(); }

    static bool rises(rtcf::Input<bool>& in, rtcf::State<bool>& was) {
        if (in.read() == rtcf::DataStatus::None) return false;
        const bool rising = in.value() && !was;
        was = in.value();
        return rising;
    }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::Counter, "Counter",
                     "Counts up and down at the rising edges of two inputs", Counter)
