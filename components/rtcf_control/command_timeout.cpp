#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include <rtcf/component.hpp>

#include "bounded_step.hpp"
#include "latch.hpp"

namespace rtcf_control {
namespace {

class CommandTimeout final : public rtcf::Component {
    static constexpr double kInfinity = std::numeric_limits<double>::infinity();

    rtcf::Input<double> in{this, "in"};
    rtcf::Input<bool> reset{this, "reset"};
    rtcf::Output<double> out{this, "out", "", rtcf::Finite()};
    rtcf::Output<bool> stopped{this, "stopped"};
    rtcf::Output<std::int32_t> state{this, "state"};
    rtcf::Output<double> age{this, "age", "s", rtcf::Finite()};

    rtcf::Parameter<double> timeout{
        this,
        "timeout",
        0.1,
        rtcf::Min(0.0),
        rtcf::Max(1e6),
        rtcf::Unit("s"),
        rtcf::Doc("longest time without a new command; 0 = each cycle needs one")};
    rtcf::Parameter<bool> latching{
        this, "latching", true,
        rtcf::Doc("a timeout needs a reset; false: the next command ends it")};
    rtcf::Parameter<double> safe_value{
        this, "safe_value", 0.0,
        rtcf::Doc("output before the first command, during a stop and in the last cycle")};
    rtcf::Parameter<double> stop_rate{
        this,
        "stop_rate",
        kInfinity,
        rtcf::Min(1e-9),
        rtcf::Unit("1/s"),
        rtcf::Doc("rate of change to safe_value; infinite = at once")};
    rtcf::Parameter<double> resume_rate{
        this,           "resume_rate",     kInfinity,
        rtcf::Min(0.0), rtcf::Unit("1/s"), rtcf::Doc("rate of change to the command after a stop")};

    rtcf::State<Latch> latch_{this, "latch", {}, rtcf::Live()};
    rtcf::State<std::int64_t> age_{
        this,        "since_command", 0, rtcf::Unit("ns"), rtcf::Doc("time since the last command"),
        rtcf::Live()};
    rtcf::State<double> last_{this, "last", 0.0, rtcf::Doc("the last output"), rtcf::Live()};
    rtcf::State<bool> begun_{this, "begun", false, rtcf::Doc("the first command has come"),
                             rtcf::Live()};
    rtcf::State<bool> resumes_{this, "resumes", false,
                               rtcf::Doc("the output moves to the command at resume_rate"),
                               rtcf::Live()};

    bool start() override {
        latch_ = Latch{};
        age_ = 0;
        last_ = safe_value.value();
        begun_ = false;
        resumes_ = true;
        return true;
    }

    void safe() noexcept override {
        last_ = safe_value.value();
        out.write(last_);
    }

    void update() override {
        // A command that is not finite is no command.
        const bool arrived = in.read() == rtcf::DataStatus::New && std::isfinite(in.value());
        age_ = arrived ? 0 : age_ + elapsed();
        begun_ = begun_ || arrived;
        const bool late = begun_ && age_ > std::llround(timeout * 1e9);
        const bool wanted = reset.read() != rtcf::DataStatus::None && reset.value();
        const bool was_stopped = latch_.value().stopped();
        const bool ends = latch_.value().update(late, arrived, wanted);
        const bool returns = was_stopped && !latching && arrived;
        if (returns) latch_ = Latch{};
        if (ends || returns) resumes_ = true;
        if (latch_.value().stopped() || !begun_) {
            move(safe_value, stop_rate);
        } else if (std::isfinite(in.value())) {
            move(in.value(), resumes_ ? resume_rate.value() : kInfinity);
            if (last_ == in.value()) resumes_ = false;
        }
        out.write(last_);
        stopped.write(latch_.value().stopped());
        state.write(begun_ ? latch_.value().state()
                           : static_cast<std::int32_t>(StopState::Waiting));
        age.write(1e-9 * static_cast<double>(age_.value()));
    }

    void move(double target, double rate) {
        const double largest = rate * boundedStep(dt(), period());
        last_ = std::clamp(target, last_ - largest, last_ + largest);
    }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::CommandTimeout, "CommandTimeout",
                     "Stops a command that is not renewed in time; a reset needs a command newer "
                     "than the stop",
                     CommandTimeout)
