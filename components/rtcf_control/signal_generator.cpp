#include <algorithm>
#include <cstdint>
#include <limits>
#include <string>

#include <rtcf/component.hpp>
#include <rtcf/design_period.hpp>

#include "waveform.hpp"

namespace rtcf_control {
namespace {

class SignalGenerator final : public rtcf::Component {
    static constexpr double kInfinity = std::numeric_limits<double>::infinity();

    rtcf::Input<bool> enable{this, "enable"};
    rtcf::Output<double> out{this, "out", "", rtcf::Finite()};

    rtcf::Parameter<Shape> shape{this,
                                 "shape",
                                 Shape::Sine,
                                 rtcf::Choice("step", Shape::Step),
                                 rtcf::Choice("ramp", Shape::Ramp),
                                 rtcf::Choice("sine", Shape::Sine),
                                 rtcf::Choice("square", Shape::Square),
                                 rtcf::Choice("triangle", Shape::Triangle),
                                 rtcf::Choice("linear_chirp", Shape::LinearChirp),
                                 rtcf::Choice("log_chirp", Shape::LogChirp),
                                 rtcf::Choice("prbs", Shape::Prbs),
                                 rtcf::Choice("multisine", Shape::Multisine),
                                 rtcf::Doc("form of the signal")};
    rtcf::Parameter<bool> enabled{this, "enabled", true,
                                  rtcf::Doc("run the signal, until enable has a value")};
    rtcf::Parameter<double> amplitude{
        this, "amplitude", 1.0, rtcf::Doc("height of a step or ramp, peak value of other signals")};
    rtcf::Parameter<double> offset{this, "offset", 0.0, rtcf::Doc("added to the signal")};
    rtcf::Parameter<double> frequency_{this,
                                       "frequency",
                                       1.0,
                                       rtcf::Min(0.0),
                                       rtcf::Max(1e6),
                                       rtcf::Unit("Hz"),
                                       rtcf::Doc("frequency; of a chirp the first, of a multisine "
                                                 "the lowest, of a PRBS the bits per second")};
    rtcf::Parameter<double> end_frequency{this,
                                          "end_frequency",
                                          10.0,
                                          rtcf::Min(0.0),
                                          rtcf::Max(1e6),
                                          rtcf::Unit("Hz"),
                                          rtcf::Doc("last frequency of a chirp")};
    rtcf::Parameter<double> duration{
        this,
        "duration",
        10.0,
        rtcf::Min(1e-6),
        rtcf::Max(1e6),
        rtcf::Unit("s"),
        rtcf::Doc("duration of a ramp, and of a chirp, which then begins again")};
    rtcf::Parameter<double> delay{this,
                                  "delay",
                                  0.0,
                                  rtcf::Min(0.0),
                                  rtcf::Max(1e6),
                                  rtcf::Unit("s"),
                                  rtcf::Doc("time before a step or ramp")};
    rtcf::Parameter<std::int32_t> lines{
        this,           "lines",         10,
        rtcf::Min(1.0), rtcf::Max(64.0), rtcf::Doc("number of sines of a multisine")};
    rtcf::Parameter<double> lower{this, "lower", -kInfinity,
                                  rtcf::Doc("lower limit of the output")};
    rtcf::Parameter<double> upper{this, "upper", kInfinity, rtcf::Doc("upper limit of the output")};

    rtcf::State<bool> begun_{this, "begun", false, rtcf::Doc("the signal runs")};
    rtcf::State<std::int64_t> time_{this, "time", 0, rtcf::Unit("ns"),
                                    rtcf::Doc("time since the signal began")};
    rtcf::State<double> phase_{this, "phase", 0.0, rtcf::Doc("phase of the wave, from 0 to 1")};
    rtcf::State<std::uint32_t> register_{this, "register", kPrbsStart,
                                         rtcf::Doc("shift register of PRBS")};
    rtcf::Derived<double> peak_{this, 1.0};  // of the multisine
    rtcf::DesignPeriod design_period_{this};
    bool is_configured_ = false;

    bool prepare(const rtcf::Values& proposed) override {
        if (proposed[lower] > proposed[upper])
            return RTCF_FAIL(this, "lower = {} is above upper = {}", proposed[lower],
                             proposed[upper]);
        const Waveform next{proposed[shape],    proposed[frequency_], proposed[end_frequency],
                            proposed[duration], proposed[delay],      proposed[lines]};
        if (const char* const error = next.frequencyError()) return fail(error);
        const Waveform present = waveform();
        if (const std::string error =
                proposalError(this, next, is_configured_ ? &present : nullptr, design_period_);
            !error.empty())
            return fail("{}", error);
        if (proposed[shape] == Shape::Multisine) peak_.stage(peakOfMultisine(proposed[lines]));
        return true;
    }

    bool configure() override {
        is_configured_ = true;
        return true;
    }

    bool start() override {
        restart();
        return true;
    }

    void safe() noexcept override { write(0.0); }

    void update() override {
        const bool runs =
            enable.read() != rtcf::DataStatus::None ? enable.value() : enabled.value();
        if (!runs) {
            restart();
            write(0.0);
            return;
        }
        write(amplitude * wave().next(waveform(), elapsed()));
    }

    void restart() { wave().restart(); }

    void write(double signal) noexcept {
        const double value = offset + signal;
        // NaN (overflow) is rejected: readers keep the last output.
        out.write(std::clamp(value, lower.value(), upper.value()));
    }

    WaveState wave() noexcept {
        return {begun_.value(), time_.value(), phase_.value(), register_.value()};
    }

    Waveform waveform() const noexcept {
        return {shape, frequency_, end_frequency, duration, delay, lines, *peak_};
    }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::SignalGenerator, "SignalGenerator",
                     "Step, ramp, sine, square, triangle, chirp, PRBS or multisine, within limits",
                     SignalGenerator)
