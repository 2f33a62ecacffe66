// A wave generator with a parameter of each kind and a log record in each hook,
// for the launch files parameters.launch and logging.launch.
#include <std_msgs/Float64.h>

#include <cmath>

#include <rtcf/component.hpp>

namespace {

enum class Shape { Sine, Square };

class Wave final : public rtcf::Component {
    rtcf::Output<std_msgs::Float64> wave{this, "wave"};

    rtcf::Parameter<double> amplitude{this,           "amplitude",     1.0,
                                      rtcf::Min(0.0), rtcf::Max(10.0), rtcf::Doc("peak value")};
    rtcf::Parameter<double> rate{this,
                                 "rate",
                                 1.0,
                                 rtcf::Min(0.0),
                                 rtcf::Max(1e3),
                                 rtcf::Unit("Hz"),
                                 rtcf::Doc("waves per second")};
    rtcf::Parameter<Shape> shape{this, "shape", Shape::Sine, rtcf::Choice("sine", Shape::Sine),
                                 rtcf::Choice("square", Shape::Square)};
    rtcf::Parameter<bool> silent{this, "silent", false, rtcf::Doc("write 0 instead of the wave")};

    rtcf::State<double> phase_{this, "phase", 0.0, rtcf::Doc("phase of the wave, from 0 to 1")};
    rtcf::State<bool> above_{this, "above", false, rtcf::Doc("the wave was above 0")};

    bool configure() override {
        RTCF_INFO(this, "configured: amplitude {}, rate {} Hz", amplitude.value(), rate.value());
        return true;
    }

    bool start() override {
        RTCF_INFO(this, "started");
        return true;
    }

    void update() override {
        phase_ = std::fmod(phase_ + rate / frequency(), 1.0);
        const double sine = std::sin(2.0 * kPi * phase_);
        const double unit = shape == Shape::Sine ? sine : std::copysign(1.0, sine);
        wave.value().data = silent ? 0.0 : amplitude * unit;
        wave.publish();
        RTCF_DEBUG(this, "wave at phase {}", phase_.value());
        if (const bool above = sine > 0.0; above != above_) {
            above_ = above;
            RTCF_INFO_THROTTLE(this, 1.0, "{} through zero in cycle {}", above ? "up" : "down",
                               iteration());
        }
        if (amplitude > kLoud)
            RTCF_WARN_THROTTLE(this, 5.0, "amplitude {} is large", amplitude.value());
    }

    void stop() override { RTCF_INFO(this, "stopped"); }

    static constexpr double kPi = 3.14159265358979323846;
    static constexpr double kLoud = 9.0;
};

}  // namespace

RTCF_COMPONENT(Wave, "Wave generator; an example of parameters and logging")
