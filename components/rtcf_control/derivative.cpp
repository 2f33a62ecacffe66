#include <algorithm>
#include <cmath>

#include <rtcf/component.hpp>

namespace rtcf_control {
namespace {

class Derivative final : public rtcf::Component {
    static constexpr double kLongest = 2.0;  // intervals for which the rate is held

    rtcf::Input<double> in{this, "in"};
    rtcf::Output<double> out{this, "out", "", rtcf::Finite()};

    rtcf::Parameter<double> gain{this, "gain", 1.0, rtcf::Unit("s"),
                                 rtcf::Doc("factor of the rate of change")};
    rtcf::Parameter<double> filter_time{
        this,           "filter_time",   0.0,
        rtcf::Min(0.0), rtcf::Unit("s"), rtcf::Doc("time constant of the filter; 0 = no filter")};

    rtcf::State<double> rate_{this, "rate", 0.0, rtcf::Unit("1/s"), rtcf::Doc("filtered rate")};
    rtcf::State<double> last_{this, "last", 0.0, rtcf::Doc("the last input")};
    rtcf::State<double> gap_{this, "gap", 0.0, rtcf::Unit("s"),
                             rtcf::Doc("time without a new finite input")};
    rtcf::State<double> interval_{this, "interval", 0.0, rtcf::Unit("s"),
                                  rtcf::Doc("time between the last two new inputs")};
    rtcf::State<bool> begun_{this, "begun", false, rtcf::Doc("the first value has come")};

    bool start() override {
        rate_ = 0.0;
        gap_ = 0.0;
        begun_ = false;
        return true;
    }

    void update() override {
        const rtcf::DataStatus status = in.read();
        if (status == rtcf::DataStatus::None) return;
        const double value = in.value();
        if (!std::isfinite(value)) {
            gap_ += dt();
            out.write(value);  // rejected as not finite: readers keep the last output
            return;
        }
        if (begun_ && status != rtcf::DataStatus::New) {
            hold();
            return;
        }
        if (begun_) {
            rate_ = (filter_time * rate_ + value - last_) / (filter_time + gap_ + dt());
            interval_ = gap_ + dt();
        }
        out.write(gain * rate_);
        last_ = value;
        gap_ = 0.0;
        begun_ = std::isfinite(rate_.value());
        if (!begun_) rate_ = 0.0;  // overflow, which the filter would keep
    }

    // Keeps the rate for as long as a slow source may take, also if one of its values is lost. Then
    // the rate falls as 1 / time: a later value would not have changed by more.
    void hold() {
        const double before = gap_;
        gap_ += dt();
        if (gap_ > kLongest * interval_) rate_ *= std::max(before, kLongest * interval_) / gap_;
        out.write(gain * rate_);
    }

    // Runs in the last cycle, too, to pass on the safe command of an upstream component.
    void safe() noexcept override { update(); }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::Derivative, "Derivative",
                     "Rate of change with a first-order filter, by backward differences (Åström & "
                     "Hägglund, Advanced PID Control, 2006, chapter 13)",
                     Derivative)
