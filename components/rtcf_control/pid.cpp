#include <algorithm>
#include <cmath>
#include <limits>

#include <rtcf/component.hpp>

#include "measurement_watch.hpp"

namespace rtcf_control {
namespace {

enum class AntiWindup { BackCalculation, Clamping, Off };

class Pid final : public rtcf::Component {
    static constexpr double kInfinity = std::numeric_limits<double>::infinity();

    rtcf::Input<double> setpoint{this, "setpoint"};
    rtcf::Input<double> measured{this, "measured"};
    rtcf::Input<double> feedforward{this, "feedforward"};
    rtcf::Input<double> gain{this, "gain"};
    rtcf::Input<double> actual{this, "actual"};
    rtcf::Input<bool> manual{this, "manual"};
    rtcf::Input<double> manual_effort{this, "manual_effort"};
    rtcf::Output<double> effort{this, "effort", "", rtcf::Finite()};
    rtcf::Output<double> error{this, "error", "", rtcf::Finite()};
    rtcf::Output<bool> saturated{this, "saturated"};

    rtcf::Parameter<double> kp{this, "kp", 1.0, rtcf::Doc("proportional gain")};
    rtcf::Parameter<double> ki{this, "ki", 0.0, rtcf::Unit("1/s"), rtcf::Doc("integral gain")};
    rtcf::Parameter<double> kd{this, "kd", 0.0, rtcf::Unit("s"), rtcf::Doc("derivative gain")};
    rtcf::Parameter<double> setpoint_weight{
        this,
        "setpoint_weight",
        1.0,
        rtcf::Min(0.0),
        rtcf::Max(1.0),
        rtcf::Doc("weight of the setpoint in the proportional term")};
    rtcf::Parameter<double> derivative_weight{
        this,
        "derivative_weight",
        0.0,
        rtcf::Min(0.0),
        rtcf::Max(1.0),
        rtcf::Doc("weight of the setpoint in the derivative term")};
    rtcf::Parameter<double> filter_time{this,
                                        "filter_time",
                                        0.0,
                                        rtcf::Min(0.0),
                                        rtcf::Unit("s"),
                                        rtcf::Doc("time constant of the derivative's filter; 0 = "
                                                  "no filter")};
    rtcf::Parameter<double> dead_band{this, "dead_band", 0.0, rtcf::Min(0.0),
                                      rtcf::Doc("errors up to this size count as 0")};
    rtcf::Parameter<double> lower{this, "lower", -kInfinity, rtcf::Doc("lower limit of effort")};
    rtcf::Parameter<double> upper{this, "upper", kInfinity, rtcf::Doc("upper limit of effort")};
    rtcf::Parameter<double> rate{this,
                                 "rate",
                                 kInfinity,
                                 rtcf::Min(0.0),
                                 rtcf::Unit("1/s"),
                                 rtcf::Doc("largest rate of change of effort; 0 holds it")};
    rtcf::Parameter<double> setpoint_rate{
        this,
        "setpoint_rate",
        kInfinity,
        rtcf::Min(0.0),
        rtcf::Unit("1/s"),
        rtcf::Doc("largest rate of change of the followed setpoint")};
    rtcf::Parameter<AntiWindup> anti_windup{
        this,
        "anti_windup",
        AntiWindup::BackCalculation,
        rtcf::Choice("back_calculation", AntiWindup::BackCalculation),
        rtcf::Choice("clamping", AntiWindup::Clamping),
        rtcf::Choice("off", AntiWindup::Off),
        rtcf::Doc("method for the integral while effort is limited")};
    rtcf::Parameter<double> tracking_time{
        this,
        "tracking_time",
        0.0,
        rtcf::Min(0.0),
        rtcf::Unit("s"),
        rtcf::Doc("time constant of back-calculation; 0 = |kp / ki|")};
    rtcf::Parameter<bool> in_manual{this, "in_manual", false,
                                    rtcf::Doc("manual mode, until manual has a value")};
    rtcf::Parameter<double> manual_value{
        this, "manual_value", 0.0, rtcf::Doc("manual effort, until manual_effort has a value")};
    rtcf::Parameter<bool> setpoint_tracking{
        this, "setpoint_tracking", false,
        rtcf::Doc("in manual mode, set the followed setpoint to the measured value")};
    rtcf::Parameter<double> safe_effort{
        this, "safe_effort", 0.0,
        rtcf::Doc("effort before the first cycle, in the last one, and while measured is lost; "
                  "within the limits")};
    MeasurementWatch<1> watch_{this, {"measured"}, "effort moves to safe_effort"};

    // Everything by which the terms of the present error are multiplied.
    struct Gains {
        double kp = 0.0;
        double kd = 0.0;
        double setpoint_weight = 0.0;
        double derivative_weight = 0.0;
        double dead_band = 0.0;
        double schedule = 0.0;
        bool operator!=(const Gains& other) const {
            return kp != other.kp || kd != other.kd || setpoint_weight != other.setpoint_weight ||
                   derivative_weight != other.derivative_weight || dead_band != other.dead_band ||
                   schedule != other.schedule;
        }
        template <typename Visit>
        void fields(Visit&& visit) {
            visit("kp", kp);
            visit("kd", kd);
            visit("setpoint_weight", setpoint_weight);
            visit("derivative_weight", derivative_weight);
            visit("dead_band", dead_band);
            visit("schedule", schedule);
        }
    };

    // 1 / Tt, 1/s; NaN without kp and ki, and then not used.
    rtcf::Derived<double> tracking_rate_{this};

    rtcf::State<double> integral_{this, "integral", 0.0,
                                  rtcf::Doc("integral term, part of effort")};
    rtcf::State<double> setpoint_slope_{this, "setpoint_slope", 0.0, rtcf::Unit("1/s"),
                                        rtcf::Doc("filtered rate of the setpoint")};
    rtcf::State<double> measured_slope_{this, "measured_slope", 0.0, rtcf::Unit("1/s"),
                                        rtcf::Doc("filtered rate of the measured value")};
    rtcf::State<double> setpoint_{this, "followed", 0.0, rtcf::Doc("setpoint after its rate limit"),
                                  rtcf::Live()};
    rtcf::State<double> measured_{this, "last_measured", 0.0, rtcf::Doc("last measured value")};
    rtcf::State<double> effort_{this, "last_effort", 0.0, rtcf::Doc("effort of the last cycle"),
                                rtcf::Live()};
    rtcf::State<double> gap_{
        this, "gap", 0.0, rtcf::Unit("s"),
        rtcf::Doc("time without finite inputs, since the last cycle with them")};
    rtcf::State<double> interval_{this, "interval", 0.0, rtcf::Unit("s"),
                                  rtcf::Doc("time between the last two new measured values")};
    rtcf::State<bool> begun_{this, "begun", false, rtcf::Doc("the followed values are valid"),
                             rtcf::Live()};
    rtcf::State<bool> resume_{this, "resume", false,
                              rtcf::Doc("set the integral to continue from the last effort"),
                              rtcf::Live()};
    rtcf::State<Gains> gains_{
        this, "gains", {}, rtcf::Doc("gains of the last cycle"), rtcf::Live()};

    bool prepare(const rtcf::Values& proposed) override {
        if (proposed[lower] > proposed[upper])
            return RTCF_FAIL(this, "lower = {} is above upper = {}", proposed[lower],
                             proposed[upper]);
        if (proposed[setpoint_tracking] && std::isinf(proposed[setpoint_rate]))
            return fail(
                "setpoint_tracking needs a finite setpoint_rate: in automatic mode, the "
                "followed setpoint returns to its input at this rate");
        tracking_rate_.stage(proposed[tracking_time] > 0.0 ? 1.0 / proposed[tracking_time]
                                                           : std::abs(proposed[ki] / proposed[kp]));
        return true;
    }

    bool start() override {
        integral_ = 0.0;
        effort_ = std::clamp(safe_effort.value(), lower.value(), upper.value());
        begun_ = false;
        resume_ = false;
        gap_ = 0.0;
        watch_.begin();
        return true;
    }

    void safe() noexcept override {
        effort.write(std::clamp(safe_effort.value(), lower.value(), upper.value()));
    }

    // Continues from the effort of a component of another type.
    void takeOver(const rtcf::Predecessor& previous) noexcept override {
        if (previous.state<Gains>("gains") != nullptr) return;  // a Pid, whose state is complete
        begun_ = false;
        const auto* last = previous.output<double>("effort");
        if (last == nullptr || !std::isfinite(*last)) return;
        effort_ = *last;
        resume_ = true;
    }

    void update() override {
        const bool has_setpoint = setpoint.read() != rtcf::DataStatus::None;
        const rtcf::DataStatus measurement = measured.read();
        const double forward = valueOr(feedforward, 0.0);
        const double schedule = valueOr(gain, 1.0);
        const bool by_hand = valueOr(manual, in_manual.value());
        const double by_hand_effort = valueOr(manual_effort, manual_value.value());
        const bool has_actual = actual.read() != rtcf::DataStatus::None && actual.connected(this) &&
                                std::isfinite(actual.value());
        const double r = setpoint.value();
        const double y = measured.value();
        const std::int64_t silence = watch_.silence(0);
        const bool is_new = measurement == rtcf::DataStatus::New && std::isfinite(y);
        const char* fault = measurement != rtcf::DataStatus::None
                                ? watch_.note(0, y, measured.age(this), elapsed())
                                : nullptr;
        if (fault == nullptr && !std::isfinite(r + y + forward + schedule))
            fault = notFinite(r, forward);
        const bool complete = has_setpoint && watch_.valid(0);
        if (!complete || fault != nullptr) {
            if (fault != nullptr) reportFault(fault);
            if (complete) gap_ += dt();
            if (by_hand) {
                driveBlind(by_hand_effort);
            } else if (complete && (watch_.lost(0) || gap_ > watch_.timeout())) {
                driveBlind(safe_effort);
            }  // else readers keep the last effort, and the state stays as it is
            return;
        }
        const double step = dt();
        const std::int64_t since = is_new ? silence + elapsed() - watch_.silence(0) : 0;
        follow(r, y, 1e-9 * static_cast<double>(since), by_hand && setpoint_tracking, step);
        adoptGains(schedule);
        const double rest = terms(gains_) + forward;
        if (!std::isfinite(rest)) {
            // After an overflow, restart from the last effort, because the slopes would keep it.
            effort.write(rest);  // rejected, as above
            begun_ = false;
            resume_ = true;
            return;
        }
        if (resume_ && ki != 0.0) integral_ = effort_ - rest;
        resume_ = false;

        const double wanted = by_hand ? by_hand_effort : rest + integral_;
        if (!std::isfinite(wanted)) {
            effort.write(wanted);  // rejected, as above
            return;
        }
        const double limited = limit(wanted, step);
        if (by_hand) {
            // Ready for automatic mode: the same effort in the next cycle.
            if (ki != 0.0) integral_ = limited - rest;
        } else {
            // `actual` is the measured effort of the last cycle, at best.
            const double lost = has_actual ? effort_ - actual.value() : 0.0;
            integrate(schedule * ki * withoutBand(setpoint_ - y, dead_band), wanted - limited, lost,
                      step);
        }
        effort_ = limited;
        effort.write(limited);
        error.write(setpoint_ - y);
        saturated.write(limited != wanted);
    }

    // The text of a fault: the first of the setpoint, the feed-forward and the gain that is wrong.
    static const char* notFinite(double r, double forward) {
        if (!std::isfinite(r)) return "setpoint is not finite";
        return std::isfinite(forward) ? "gain is not finite" : "feedforward is not finite";
    }

    template <typename T>
    static T valueOr(rtcf::Input<T>& input, T otherwise) {
        return input.read() != rtcf::DataStatus::None ? input.value() : otherwise;
    }

    // An effort without usable inputs, e.g. without a sensor. Automatic mode then resumes from this
    // effort.
    void driveBlind(double wanted) {
        begun_ = false;
        resume_ = true;
        if (!std::isfinite(wanted)) {
            effort.write(wanted);  // rejected as not finite
            return;
        }
        effort_ = limit(wanted, dt());
        effort.write(effort_);
        saturated.write(effort_ != wanted);
    }

    // Moves the followed setpoint and the filtered slopes by one cycle.
    // since: from the last measured value to this one, s; 0 = this one is not new
    void follow(double r, double y, double since, bool track, double elapsed) {
        if (!begun_) {
            setpoint_ = track ? y : r;
            measured_ = y;
            setpoint_slope_ = 0.0;
            measured_slope_ = 0.0;
            gains_ = Gains{};
            gap_ = 0.0;
            interval_ = 0.0;
            return;
        }
        const double before = setpoint_;
        const double largest = setpoint_rate * elapsed;
        setpoint_ = track ? y : std::clamp(r, before - largest, before + largest);
        setpoint_slope_ =
            (filter_time * setpoint_slope_ + setpoint_ - before) / (filter_time + gap_ + elapsed);
        gap_ = 0.0;
        // The sensor may be slower than the loop: its slope holds until its next value is due.
        if (since > 0.0) {
            measured_slope_ =
                (filter_time * measured_slope_ + y - measured_) / (filter_time + since);
            measured_ = y;
            interval_ = since;
        } else if (1e-9 * static_cast<double>(watch_.silence(0)) > 2.0 * interval_) {
            measured_slope_ *= filter_time / (filter_time + elapsed);
        }
    }

    // The integral absorbs the jump of the other terms after a change of gains, so that effort does
    // not jump. Without integral action nothing would remove this part again, so effort jumps.
    void adoptGains(double schedule) {
        const Gains now{kp, kd, setpoint_weight, derivative_weight, dead_band, schedule};
        if (now != gains_.value()) {
            if (begun_ && ki != 0.0) integral_ += terms(gains_) - terms(now);
            gains_ = now;
        }
        begun_ = true;
    }

    // The proportional and the derivative term.
    double terms(const Gains& g) const {
        const double e = setpoint_ - measured_;
        // The dead band reduces the weighted error by the same amount as the error.
        const double weighted =
            g.setpoint_weight * setpoint_ - measured_ - e + withoutBand(e, g.dead_band);
        return g.schedule *
               (g.kp * weighted + g.kd * (g.derivative_weight * setpoint_slope_ - measured_slope_));
    }

    static double withoutBand(double e, double band) { return e - std::clamp(e, -band, band); }

    double limit(double wanted, double elapsed) const {
        const double step = rate * elapsed;
        const double slow = std::clamp(wanted, effort_ - step, effort_ + step);
        // Limits that have become narrower hold at once.
        return std::clamp(slow, lower.value(), upper.value());
    }

    // Moves the integral by one cycle. `excess` is the effort beyond the limits, `lost` the effort
    // that the actuator has not applied.
    void integrate(double slope, double excess, double lost, double step) {
        switch (anti_windup.value()) {
            case AntiWindup::BackCalculation: {
                if (ki == 0.0) return;
                integral_ +=
                    slope * step - std::min(1.0, step * tracking_rate_.value()) * (excess + lost);
                return;
            }
            case AntiWindup::Clamping:
                // The integral stands while it would drive effort further beyond the limit.
                if (excess * slope <= 0.0) integral_ += slope * step;
                return;
            case AntiWindup::Off:
                integral_ += slope * step;
                return;
        }
    }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::Pid, "Pid",
                     "PID controller with two degrees of freedom (Åström & Hägglund, Advanced PID "
                     "Control, 2006, chapters 3 and 13)",
                     Pid)
