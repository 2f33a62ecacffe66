#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include <rtcf/component.hpp>

namespace rtcf_control {
namespace {

enum class Shape { Step, Ramp, Sine, Square, Triangle, LinearChirp, LogChirp, Prbs, Multisine };

constexpr double kTurn = 6.28318530717958647692;  // 2 pi
// Phases closer than this to an edge count as on it: sums of rounded steps miss it by less.
constexpr double kPhaseTolerance = 1e-9;

// The sum of `lines` sines, multiples of the frequency, with the phases of Schroeder (Synthesis of
// low-peak-factor signals, IEEE Transactions on Information Theory, 1970), which keep its peak low.
// Real-time safe.
double multisine(int lines, double phase) {
    double sum = 0.0;
    for (int k = 1; k <= lines; ++k)
        sum += std::sin(kTurn * k * phase - kTurn / 2.0 * k * (k - 1) / lines);
    return sum;
}

// Largest absolute value of this sum. Not real-time: takes some ms.
double peakOfMultisine(int lines) {
    const int points = 256 * lines;
    double peak = 0.0;
    for (int i = 0; i < points; ++i)
        peak = std::max(peak, std::abs(multisine(lines, static_cast<double>(i) / points)));
    return peak;
}

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

    rtcf::State<std::int64_t> time_{this, "time", 0, rtcf::Unit("ns"),
                                    rtcf::Doc("time since the signal began")};
    rtcf::State<double> phase_{this, "phase", 0.0, rtcf::Doc("phase of the wave, from 0 to 1")};
    rtcf::State<std::uint32_t> register_{this, "register", 1, rtcf::Doc("shift register of PRBS")};
    rtcf::Derived<double> peak_{this, 1.0};  // of the multisine

    bool prepare(const rtcf::Values& proposed) override {
        if (proposed[lower] > proposed[upper])
            return RTCF_FAIL(this, "lower = {} is above upper = {}", proposed[lower],
                             proposed[upper]);
        if (proposed[shape] == Shape::LogChirp &&
            (proposed[frequency_] <= 0.0 || proposed[end_frequency] <= 0.0))
            return fail("log_chirp: frequency and end_frequency must be above 0 Hz");
        if (proposed[shape] == Shape::Multisine) peak_.stage(peakOfMultisine(proposed[lines]));
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
        write(amplitude * unit());
        advance();
    }

    void restart() {
        time_ = 0;
        phase_ = 0.0;
        register_ = 1U;
    }

    void write(double signal) noexcept {
        const double value = offset + signal;
        // NaN (overflow) is rejected by the check: readers keep the last output.
        out.write(std::clamp(value, lower.value(), upper.value()));
    }

    static std::int64_t nanoseconds(double seconds) { return std::llround(seconds * 1e9); }

    // Value of the signal in this cycle, between -1 and 1.
    double unit() const {
        const std::int64_t since = time_ - nanoseconds(delay);
        switch (shape.value()) {
            case Shape::Step:
                return since >= 0 ? 1.0 : 0.0;
            case Shape::Ramp:
                return std::clamp(1e-9 * static_cast<double>(since) / duration, 0.0, 1.0);
            case Shape::Sine:
            case Shape::LinearChirp:
            case Shape::LogChirp:
                return std::sin(kTurn * phase_);
            case Shape::Square:
                return phase_ < 0.5 - kPhaseTolerance ? 1.0 : -1.0;
            case Shape::Triangle:
                // From 0 to 1, -1 and 0, as a sine.
                return 1.0 - 4.0 * std::abs(std::fmod(phase_ + 0.25, 1.0) - 0.5);
            case Shape::Prbs:
                return (register_ & 1U) != 0U ? 1.0 : -1.0;
            case Shape::Multisine:
                return std::clamp(multisine(lines, phase_) / *peak_, -1.0, 1.0);
        }
        return 0.0;
    }

    // Turns of a chirp from its start to a time, s.
    double turns(double time) const {
        if (shape == Shape::LinearChirp)
            return time * (frequency_ + (end_frequency - frequency_) * time / (2.0 * duration));
        const double ratio = std::log(end_frequency / frequency_);
        return ratio == 0.0 ? frequency_ * time
                            : frequency_ * duration / ratio * std::expm1(ratio * time / duration);
    }

    void advance() {
        const bool chirps = shape == Shape::LinearChirp || shape == Shape::LogChirp;
        const double before = 1e-9 * static_cast<double>(time_);
        time_ += elapsed();
        if (chirps && time_ >= nanoseconds(duration)) {
            time_ = 0;
            phase_ = 0.0;
            return;
        }
        phase_ +=
            chirps ? turns(1e-9 * static_cast<double>(time_)) - turns(before) : frequency_ * dt();
        const double whole = std::floor(phase_ + kPhaseTolerance);
        phase_ -= whole;
        // At most one new bit a cycle. x^15 + x^14 + 1 has the period 32767.
        if (shape == Shape::Prbs && whole > 0.0) {
            const std::uint32_t bit = ((register_ >> 14U) ^ (register_ >> 13U)) & 1U;
            register_ = ((register_ << 1U) | bit) & 0x7FFFU;
            if (register_ == 0U) register_ = 1U;
        }
    }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::SignalGenerator, "SignalGenerator",
                     "Step, ramp, sine, square, triangle, chirp, PRBS or multisine, within limits",
                     SignalGenerator)
