#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include <rtcf/component.hpp>

#include "bounded_step.hpp"
#include "latch.hpp"

namespace rtcf_control {
namespace {

// Velocity of a command that may come in steps, at a lower rate than the loop's: from its changes,
// each over the time since the one before. The median of three, so that one jump of the command is
// no velocity.
class CommandVelocity {
   public:
    /// Notes the command of a cycle. Real-time safe.
    /// @param elapsed_s time since the last cycle
    void note(double command, double elapsed_s) noexcept {
        since_s_ += elapsed_s;
        if (known_ && command == last_) return;
        if (known_ && since_s_ > 0.0) {
            rates_ = {(command - last_) / since_s_, rates_[0], rates_[1]};
            interval_s_ = since_s_;
        }
        known_ = true;
        last_ = command;
        since_s_ = 0.0;
    }
    /// 1/s. A command that does not change any more slows down. Real-time safe.
    double value() const noexcept {
        const double low = std::min(rates_[0], rates_[1]);
        const double high = std::max(rates_[0], rates_[1]);
        const double median = std::clamp(rates_[2], low, high);
        return since_s_ > interval_s_ ? median * interval_s_ / since_s_ : median;
    }
    template <typename Visit>
    void fields(Visit&& visit) {
        visit("known", known_);
        visit("last", last_);
        visit("since_s", since_s_);
        visit("interval_s", interval_s_);
        visit("rates", rates_);
    }

   private:
    bool known_ = false;
    double last_ = 0.0;
    double since_s_ = 0.0;     // since the last change
    double interval_s_ = 0.0;  // between the last two changes
    std::array<double, 3> rates_{};
};

class EStop final : public rtcf::Component {
    static constexpr double kInfinity = std::numeric_limits<double>::infinity();

    enum class Mode { SafeValue, Standstill };

    rtcf::Input<double> in{this, "in"};
    rtcf::Input<bool> stop1{this, "stop1"};
    rtcf::Input<bool> stop2{this, "stop2"};
    rtcf::Input<bool> stop3{this, "stop3"};
    rtcf::Input<bool> stop4{this, "stop4"};
    rtcf::Input<bool> reset{this, "reset"};
    rtcf::Output<double> out{this, "out", "", rtcf::Finite()};
    rtcf::Output<bool> stopped{this, "stopped"};
    rtcf::Output<std::int32_t> state{this, "state"};
    rtcf::Output<bool> torque_off{this, "torque_off"};

    rtcf::Parameter<bool> engaged{this, "engaged", false, rtcf::Doc("stop, as an input would")};
    rtcf::Parameter<bool> start_stopped{this, "start_stopped", true,
                                        rtcf::Doc("begin with a stop, which needs a reset")};
    rtcf::Parameter<std::int32_t> required{
        this,
        "required",
        1,
        rtcf::Min(0.0),
        rtcf::Max(4.0),
        rtcf::Doc(
            "number of inputs stop1, stop2 … that stop without a value, or if their writer ends")};
    rtcf::Parameter<Mode> mode{
        this,
        "mode",
        Mode::SafeValue,
        rtcf::Choice("safe_value", Mode::SafeValue),
        rtcf::Choice("standstill", Mode::Standstill),
        rtcf::Doc("a stop moves the output to safe_value; or, for a command of position, to a "
                  "standstill where it is; a stop under way stays as it is")};
    rtcf::Parameter<double> safe_value{this, "safe_value", 0.0,
                                       rtcf::Doc("output during a stop and in the last cycle")};
    rtcf::Parameter<double> stop_rate{
        this,
        "stop_rate",
        kInfinity,
        rtcf::Min(1e-9),
        rtcf::Unit("1/s"),
        rtcf::Doc("rate of change to safe_value; infinite = at once (stop category 0)")};
    rtcf::Parameter<double> deceleration{
        this,
        "deceleration",
        kInfinity,
        rtcf::Min(1e-9),
        rtcf::Unit("1/s^2"),
        rtcf::Doc("deceleration to the standstill; infinite = at once")};
    rtcf::Parameter<bool> keep_torque{this, "keep_torque", false,
                                      rtcf::Doc("torque_off stays false (stop category 2)")};
    rtcf::Parameter<double> resume_rate{this,
                                        "resume_rate",
                                        kInfinity,
                                        rtcf::Min(0.0),
                                        rtcf::Unit("1/s"),
                                        rtcf::Doc("rate of change to the command after a reset")};

    rtcf::State<Latch> latch_{this, "latch", {}, rtcf::Live()};
    rtcf::State<bool> standstill_{this, "standstill", false,
                                  rtcf::Doc("the stop is to a standstill"), rtcf::Live()};
    rtcf::State<std::array<bool, 4>> wired_{
        this, "wired", {}, rtcf::Doc("stop1 to stop4 have had a writer"), rtcf::Live()};
    rtcf::State<double> last_{this, "last", 0.0, rtcf::Doc("the last output"), rtcf::Live()};
    rtcf::State<CommandVelocity> velocity_{
        this, "velocity", {}, rtcf::Doc("changes of the command"), rtcf::Live()};
    rtcf::State<double> speed_{this,
                               "speed",
                               0.0,
                               rtcf::Unit("1/s"),
                               rtcf::Doc("rate of change of the last output"),
                               rtcf::Live()};
    rtcf::State<bool> known_{
        this, "known", false,
        rtcf::Doc("there is a last output; a standstill needs a first command"), rtcf::Live()};
    rtcf::State<bool> resumes_{this, "resumes", false,
                               rtcf::Doc("the output moves to the command at resume_rate"),
                               rtcf::Live()};

    bool prepare(const rtcf::Values& proposed) override {
        if (proposed[mode] == Mode::Standstill && std::isinf(proposed[resume_rate]))
            return fail(
                "mode = standstill needs a resume_rate (1/s): after a reset, a position would jump "
                "to the command");
        return true;
    }

    bool start() override {
        latch_ = Latch{};
        if (start_stopped) latch_.value().stop();
        standstill_ = mode == Mode::Standstill;
        wired_ = std::array<bool, 4>{};
        velocity_ = CommandVelocity{};
        last_ = safe_value.value();
        speed_ = 0.0;
        known_ = false;
        resumes_ = true;
        return true;
    }

    void safe() noexcept override {
        latch_.value().stop();
        if (!standstill_) {
            last_ = safe_value.value();
        } else if (!known_) {
            publishState(false);
            return;
        }
        speed_ = 0.0;
        publish(true);
    }

    void update() override {
        const std::array<rtcf::Input<bool>*, 4> stops{&stop1, &stop2, &stop3, &stop4};
        bool condition = engaged;
        for (std::size_t i = 0; i < stops.size(); ++i) {
            rtcf::Input<bool>& input = *stops[i];
            const bool has_value = input.read() != rtcf::DataStatus::None;
            const bool is_required = i < static_cast<std::size_t>(required.value());
            bool& wired = wired_.value()[i];
            wired = wired || input.connected(this);
            const bool lost = !has_value || (wired && !input.connected(this));
            condition = condition || (has_value && input.value()) || (is_required && lost);
        }
        const rtcf::DataStatus command = in.read();
        const bool usable = command != rtcf::DataStatus::None && std::isfinite(in.value());
        if (!latch_.value().stopped()) standstill_ = mode == Mode::Standstill;
        if (usable) velocity_.value().note(in.value(), dt());
        const bool wanted = reset.read() != rtcf::DataStatus::None && reset.value();
        if (latch_.value().update(condition, usable && command == rtcf::DataStatus::New, wanted))
            resumes_ = true;
        if (standstill_ && !known_) {
            // The position at which the first command begins.
            if (!usable) {
                publishState(false);
                return;
            }
            last_ = in.value();
        }
        known_ = true;
        if (latch_.value().stopped()) {
            const bool stands = standstill_ ? brake() : move(safe_value, stop_rate);
            publish(stands);
            return;
        }
        if (!usable) {
            if (command != rtcf::DataStatus::None) out.write(in.value());  // rejected as not finite
            speed_ = 0.0;
            publishState(false);
            return;
        }
        if (move(in.value(), resumes_ ? resume_rate.value() : kInfinity)) resumes_ = false;
        if (!resumes_) speed_ = velocity_.value().value();
        publish(false);
    }

    // Returns true if the output is at the target.
    bool move(double target, double rate) {
        const double before = last_;
        const double step = boundedStep(dt(), period());
        last_ = std::clamp(target, before - rate * step, before + rate * step);
        speed_ = step > 0.0 ? (last_ - before) / step : 0.0;
        return last_ == target;
    }

    // Slows down; returns true if the output stands.
    bool brake() {
        const double step = boundedStep(dt(), period());
        speed_ = std::clamp(0.0, speed_ - deceleration * step, speed_ + deceleration * step);
        last_ += speed_ * step;
        return speed_ == 0.0;
    }

    void publish(bool stands) noexcept {
        out.write(last_);
        publishState(stands);
    }

    void publishState(bool stands) noexcept {
        stopped.write(latch_.value().stopped());
        state.write(latch_.value().state());
        torque_off.write(stands && latch_.value().stopped() && !keep_torque);
    }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(
    rtcf_control::EStop, "EStop",
    "Latched stop of a command; a reset needs a command newer than the stop (after "
    "ISO 13850 and the stop categories of IEC 60204-1; not a safety-rated device)",
    EStop)
