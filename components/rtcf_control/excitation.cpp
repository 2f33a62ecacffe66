#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>

#include <rtcf/component.hpp>
#include <rtcf/design_period.hpp>

#include "measurement_watch.hpp"
#include "waveform.hpp"

namespace rtcf_control {
namespace {

enum class ExcitationShape { Step, Relay, Prbs, LinearChirp, LogChirp, Multisine };
enum class ExcitationMode { Add, Replace };

// Also the number that the component publishes.
enum class Progress : std::int32_t {
    Ready = 0,
    Running = 1,
    Completed = 2,   // the duration is over
    Stopped = 3,     // by run, stop, or the end of the loop
    LeftLimits = 4,  // by the measured value, or it is lost, or a value is not finite
    LeaseEnded = 5,  // run has not been renewed
    NotBegun = 6,    // in or measured is outside its limits, or there are none
};

Shape waveOf(ExcitationShape shape) noexcept {
    switch (shape) {
        case ExcitationShape::Prbs:
            return Shape::Prbs;
        case ExcitationShape::LinearChirp:
            return Shape::LinearChirp;
        case ExcitationShape::LogChirp:
            return Shape::LogChirp;
        case ExcitationShape::Multisine:
            return Shape::Multisine;
        case ExcitationShape::Step:
        case ExcitationShape::Relay:
            break;
    }
    return Shape::Step;
}

class Excitation final : public rtcf::Component {
    static constexpr double kInfinity = std::numeric_limits<double>::infinity();

    rtcf::Input<double> in{this, "in"};
    rtcf::Input<double> measured{this, "measured"};
    rtcf::Input<bool> run{this, "run"};
    rtcf::Input<bool> stop_now{this, "stop"};
    rtcf::Output<double> out{this, "out", "", rtcf::Finite()};
    rtcf::Output<double> signal{this, "signal", "", rtcf::Finite()};
    rtcf::Output<std::int32_t> state{this, "state"};
    rtcf::Output<bool> running{this, "running"};

    rtcf::Parameter<ExcitationShape> shape{
        this,
        "shape",
        ExcitationShape::Step,
        rtcf::Choice("step", ExcitationShape::Step),
        rtcf::Choice("relay", ExcitationShape::Relay),
        rtcf::Choice("prbs", ExcitationShape::Prbs),
        rtcf::Choice("linear_chirp", ExcitationShape::LinearChirp),
        rtcf::Choice("log_chirp", ExcitationShape::LogChirp),
        rtcf::Choice("multisine", ExcitationShape::Multisine),
        rtcf::Doc("form of the excitation")};
    rtcf::Parameter<ExcitationMode> mode{
        this,
        "mode",
        ExcitationMode::Add,
        rtcf::Choice("add", ExcitationMode::Add),
        rtcf::Choice("replace", ExcitationMode::Replace),
        rtcf::Doc("add the excitation to in, or to the value of in at its begin")};
    rtcf::Parameter<double> amplitude{this, "amplitude", 1.0,
                                      rtcf::Doc("height of a step, peak value of other shapes")};
    rtcf::Parameter<double> lower{this, "lower", 0.0,
                                  rtcf::Doc("lower limit of out while the excitation runs")};
    rtcf::Parameter<double> upper{
        this, "upper", 0.0,
        rtcf::Doc("upper limit of out while the excitation runs; must be above lower")};
    rtcf::Parameter<double> measured_lower{
        this, "measured_lower", -kInfinity,
        rtcf::Doc("a measured value below it stops the excitation")};
    rtcf::Parameter<double> measured_upper{
        this, "measured_upper", kInfinity,
        rtcf::Doc("a measured value above it stops the excitation")};
    rtcf::Parameter<double> delay{this,
                                  "delay",
                                  0.0,
                                  rtcf::Min(0.0),
                                  rtcf::Max(1e6),
                                  rtcf::Unit("s"),
                                  rtcf::Doc("time before the signal")};
    rtcf::Parameter<double> duration{this,
                                     "duration",
                                     10.0,
                                     rtcf::Min(1e-6),
                                     rtcf::Max(1e6),
                                     rtcf::Unit("s"),
                                     rtcf::Doc("duration of the signal, and of a chirp")};
    rtcf::Parameter<double> lease{this,
                                  "lease",
                                  1.0,
                                  rtcf::Min(0.0),
                                  rtcf::Max(1e6),
                                  rtcf::Unit("s"),
                                  rtcf::Doc("longest time without a new true on run; 0 = any")};
    rtcf::Parameter<double> frequency_{this,
                                       "frequency",
                                       1.0,
                                       rtcf::Min(0.0),
                                       rtcf::Max(1e6),
                                       rtcf::Unit("Hz"),
                                       rtcf::Doc("first frequency of a chirp, lowest one of a "
                                                 "multisine, bits per second of a PRBS")};
    rtcf::Parameter<double> end_frequency{this,
                                          "end_frequency",
                                          10.0,
                                          rtcf::Min(0.0),
                                          rtcf::Max(1e6),
                                          rtcf::Unit("Hz"),
                                          rtcf::Doc("last frequency of a chirp")};
    rtcf::Parameter<std::int32_t> lines{
        this,           "lines",         10,
        rtcf::Min(1.0), rtcf::Max(64.0), rtcf::Doc("number of sines of a multisine")};
    rtcf::Parameter<double> hysteresis{
        this, "hysteresis", 0.0, rtcf::Min(0.0),
        rtcf::Doc("distance of measured from its first value at which a relay switches")};
    rtcf::Parameter<double> idle{this, "idle", 0.0, rtcf::Doc("out until in has a value")};

    rtcf::State<std::int32_t> progress_{this, "progress", 0, rtcf::Doc("last value of state")};
    rtcf::State<bool> armed_{this, "armed", false,
                             rtcf::Doc("run was false: the next true begins")};
    rtcf::State<std::int64_t> age_{this, "age", 0, rtcf::Unit("ns"),
                                   rtcf::Doc("time since the last true on run")};
    rtcf::State<std::int64_t> since_{this, "since", 0, rtcf::Unit("ns"),
                                     rtcf::Doc("time since the begin")};
    rtcf::State<double> base_{this, "base", 0.0, rtcf::Doc("in at the begin")};
    rtcf::State<double> last_in_{this, "last_in", std::numeric_limits<double>::quiet_NaN(),
                                 rtcf::Doc("last finite in; NaN = none")};
    rtcf::State<double> reference_{this, "reference", 0.0, rtcf::Doc("measured at the begin")};
    rtcf::State<bool> high_{this, "high", true, rtcf::Doc("the relay is at amplitude")};
    rtcf::State<bool> begun_{this, "begun", false, rtcf::Doc("the signal runs")};
    rtcf::State<std::int64_t> time_{this, "time", 0, rtcf::Unit("ns"),
                                    rtcf::Doc("time since the signal began")};
    rtcf::State<double> phase_{this, "phase", 0.0, rtcf::Doc("phase of the wave, from 0 to 1")};
    rtcf::State<std::uint32_t> register_{this, "register", kPrbsStart,
                                         rtcf::Doc("shift register of PRBS")};
    rtcf::Derived<double> peak_{this, 1.0};  // of the multisine
    MeasurementWatch<1> watch_{this, {"measured"}, "the excitation ends"};
    rtcf::DesignPeriod design_period_{this};
    bool is_configured_ = false;

    bool prepare(const rtcf::Values& proposed) override {
        if (proposed[lower] > proposed[upper])
            return RTCF_FAIL(this, "lower = {} is above upper = {}", proposed[lower],
                             proposed[upper]);
        if (proposed[measured_lower] > proposed[measured_upper])
            return RTCF_FAIL(this, "measured_lower = {} is above measured_upper = {}",
                             proposed[measured_lower], proposed[measured_upper]);
        const Waveform next{waveOf(proposed[shape]),
                            proposed[frequency_],
                            proposed[end_frequency],
                            proposed[duration],
                            0.0,
                            proposed[lines]};
        if (const char* const error = next.frequencyError()) return fail(error);
        const Waveform present = waveform();
        if (const std::string error =
                proposalError(this, next, is_configured_ ? &present : nullptr, design_period_);
            !error.empty())
            return fail("{}", error);
        if (proposed[shape] == ExcitationShape::Multisine)
            peak_.stage(peakOfMultisine(proposed[lines]));
        return true;
    }

    bool configure() override {
        is_configured_ = true;
        return true;
    }

    bool start() override {
        set(Progress::Ready);
        armed_ = false;
        last_in_ = std::numeric_limits<double>::quiet_NaN();
        watch_.begin();
        return true;
    }

    // Ends the excitation, and passes on the safe command of an upstream component.
    void safe() noexcept override {
        if (runs()) set(Progress::Stopped);
        pass(base());
    }

    void update() override {
        const double command = base();
        const bool has_measured = measured.read() != rtcf::DataStatus::None;
        const char* const fault =
            has_measured ? watch_.note(0, measured.value(), measured.age(this), elapsed())
                         : nullptr;
        const rtcf::DataStatus told = run.read();
        const bool wanted = told != rtcf::DataStatus::None && run.value();
        const bool renewed = wanted && told == rtcf::DataStatus::New;
        const bool stopped = stop_now.read() != rtcf::DataStatus::None && stop_now.value();
        age_ = renewed ? 0 : age_ + elapsed();
        if (runs()) {
            since_ += elapsed();
            if (stopped || !wanted) {
                set(Progress::Stopped);
            } else if (lease > 0.0 && age_ > nanoseconds(lease)) {
                set(Progress::LeaseEnded);
            } else if (!std::isfinite(command) || !inside(has_measured)) {
                if (fault != nullptr) reportFault(fault);
                set(Progress::LeftLimits);
            } else if (since_ >= nanoseconds(delay) + nanoseconds(duration)) {
                set(Progress::Completed);
            }
        } else if (renewed && armed_ && !stopped) {
            begin(command, has_measured);
        }
        armed_ = !wanted || (armed_ && stopped);
        if (runs())
            excite(command);
        else
            pass(command);
    }

    double base() noexcept {
        const double command = in.read() != rtcf::DataStatus::None ? in.value() : idle.value();
        if (std::isfinite(command)) last_in_ = command;
        return command;
    }

    bool runs() const noexcept { return progress_ == static_cast<std::int32_t>(Progress::Running); }
    void set(Progress progress) noexcept { progress_ = static_cast<std::int32_t>(progress); }

    // The measured value is within its limits and not lost, or not needed.
    bool inside(bool has_measured) const noexcept {
        const bool needed = shape == ExcitationShape::Relay || std::isfinite(measured_lower) ||
                            std::isfinite(measured_upper);
        return !needed ||
               (has_measured && !watch_.lost(0) && std::isfinite(measured.value()) &&
                measured.value() >= measured_lower && measured.value() <= measured_upper);
    }

    void begin(double command, bool has_measured) {
        if (!(lower < upper)) {
            RTCF_WARN(this, "not begun: set lower and upper, the limits of out");
            set(Progress::NotBegun);
        } else if (!std::isfinite(command) || command < lower || command > upper) {
            RTCF_WARN(this, "not begun: in = {} is outside lower = {} to upper = {}", command,
                      lower.value(), upper.value());
            set(Progress::NotBegun);
        } else if (!inside(has_measured)) {
            RTCF_WARN(this,
                      "not begun: measured has no value or is lost, or is outside "
                      "measured_lower = {} to measured_upper = {}",
                      measured_lower.value(), measured_upper.value());
            set(Progress::NotBegun);
        } else {
            set(Progress::Running);
            base_ = command;
            reference_ = has_measured ? measured.value() : 0.0;
            high_ = true;
            since_ = 0;
            wave().restart();
        }
    }

    WaveState wave() noexcept {
        return {begun_.value(), time_.value(), phase_.value(), register_.value()};
    }
    Waveform waveform() const noexcept {
        return {waveOf(shape), frequency_, end_frequency, duration, 0.0, lines, *peak_};
    }

    void excite(double command) {
        double unit = 0.0;
        if (since_ >= nanoseconds(delay))
            unit = shape == ExcitationShape::Relay ? relay() : wave().next(waveform(), elapsed());
        const double from = mode == ExcitationMode::Add ? command : base_.value();
        const double value = std::clamp(from + amplitude * unit, lower.value(), upper.value());
        out.write(value);
        signal.write(value - from);
        publish();
    }

    // Switches when the measured value has left its first value by the hysteresis.
    double relay() noexcept {
        const double error = reference_ - measured.value();
        if (error > hysteresis) high_ = true;
        if (error < -hysteresis) high_ = false;
        return high_ ? 1.0 : -1.0;
    }

    void pass(double command) noexcept {
        if (!std::isfinite(command)) reportFault("in is not finite: out is its last finite value");
        out.write(last_in_);  // rejected if there was no finite one
        signal.write(0.0);
        publish();
    }

    void publish() noexcept {
        state.write(progress_);
        running.write(runs());
    }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::Excitation, "Excitation",
                     "Excites a loop by a step, relay, PRBS, chirp or multisine within limits, and "
                     "returns to the command before when a limit is left or its caller ends",
                     Excitation)
