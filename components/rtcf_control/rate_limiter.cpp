#include <algorithm>
#include <cmath>
#include <limits>

#include <rtcf/component.hpp>

#include "bounded_step.hpp"

namespace rtcf_control {
namespace {

class RateLimiter final : public rtcf::Component {
    static constexpr double kInfinity = std::numeric_limits<double>::infinity();

    rtcf::Input<double> in{this, "in"};
    rtcf::Output<double> out{this, "out", "", rtcf::Finite()};
    rtcf::Output<bool> limited{this, "limited"};

    rtcf::Parameter<double> rising{
        this,           "rising",          kInfinity,
        rtcf::Min(0.0), rtcf::Unit("1/s"), rtcf::Doc("largest rate upwards; 0 holds")};
    rtcf::Parameter<double> falling{
        this,           "falling",         kInfinity,
        rtcf::Min(0.0), rtcf::Unit("1/s"), rtcf::Doc("largest rate downwards; 0 holds")};

    rtcf::State<double> last_{this, "last", 0.0, rtcf::Doc("the last output"), rtcf::Live()};
    rtcf::State<bool> begun_{this, "begun", false, rtcf::Doc("the first value has passed"),
                             rtcf::Live()};

    bool start() override {
        begun_ = false;
        return true;
    }

    void update() override {
        if (in.read() == rtcf::DataStatus::None) return;
        const double wanted = in.value();
        if (!std::isfinite(wanted)) {
            out.write(wanted);  // rejected as not finite: readers keep the last output
            return;
        }
        const double step = boundedStep(dt(), period());
        const double before = begun_ ? last_.value() : wanted;
        last_ = std::clamp(wanted, before - falling * step, before + rising * step);
        begun_ = true;
        out.write(last_);
        limited.write(last_ != wanted);
    }

    // Runs in the last cycle, too, to pass on the safe command of an upstream component.
    void safe() noexcept override { update(); }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::RateLimiter, "RateLimiter",
                     "Limits the rate of change; the first value passes unlimited", RateLimiter)
