#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include <rtcf/component.hpp>
#include <rtcf/read_number.hpp>

namespace rtcf_control {
namespace {

constexpr std::size_t kMostSections = 8;
constexpr double kPi = 3.14159265358979323846;
// A design keeps the frequencies below this part of the loop's frequency; half of it is the limit
// of the bilinear transform.
constexpr double kLargestShare = 0.49;

// A section with S = s / (2 pi frequency): H = (b[0] + b[1] S + b[2] S^2) / (1 + damping S + S^2),
// or without S^2 in the denominator.
struct AnalogSection {
    double frequency = 0.0;  // Hz; the discrete section has the response of H at this frequency
    std::array<double, 3> b{1.0, 0.0, 0.0};
    double damping = 0.0;
    bool second_order = true;
    double bandwidth = 0.0;  // Hz, of a bandpass or notch: replaces damping
};

struct AnalogChain {
    std::array<AnalogSection, kMostSections> sections{};
    std::size_t count = 0;
    std::uint64_t identity = 0;  // hash of the sections
};

// A section for one period, see Biquads::filter().
struct Section {
    std::array<double, 3> b{1.0, 0.0, 0.0};
    double damping = 0.0;
    double k = 0.0;  // tan(pi frequency period)
    bool second_order = true;
    template <typename Visit>
    void fields(Visit&& visit) {
        visit("b0", b[0]);
        visit("b1", b[1]);
        visit("b2", b[2]);
        visit("damping", damping);
        visit("k", k);
        visit("second_order", second_order);
    }
};

// V = U / (1 + damping S + S^2), of the input U of a section, and its derivatives S V and S^2 V.
struct SectionMotion {
    double value = 0.0;
    double rate = 0.0;
    double acceleration = 0.0;
    template <typename Visit>
    void fields(Visit&& visit) {
        visit("value", value);
        visit("rate", rate);
        visit("acceleration", acceleration);
    }
};

// Chooses the damping of a bandpass or notch so that the gain is 1/sqrt(2) at two frequencies that
// differ by the bandwidth, as Orfanidis does (Introduction to Signal Processing, 1996, section
// 11.3). Real-time safe.
Section discretise(const AnalogSection& analog, double frequency, double bandwidth,
                   double period_s) {
    Section made{analog.b, analog.damping, std::tan(kPi * frequency * period_s),
                 analog.second_order};
    if (bandwidth > 0.0) {
        made.damping = std::tan(kPi * bandwidth * period_s) * (1.0 + made.k * made.k) / made.k;
        made.b[1] *= made.damping;
    }
    return made;
}

// Reads a chain of sections from a text such as "lowpass 100 0.707; notch 50 5".
class ChainReader {
   public:
    explicit ChainReader(double frequency_hz) : highest_(kLargestShare * frequency_hz) {}

    /// @return empty, or the error
    std::string read(const std::string& text) {
        std::istringstream all(text);
        for (std::string one; std::getline(all, one, ';');) {
            std::istringstream words(one);
            std::string kind;
            if (!(words >> kind)) continue;
            std::vector<double> numbers;
            for (std::string word; words >> word;) {
                const std::optional<double> number = rtcf::readNumber(word);
                if (!number || !std::isfinite(*number))
                    return fmt::format("{}: {} is not a number", kind, word);
                numbers.push_back(*number);
            }
            if (std::string error = section(kind, numbers); !error.empty()) return error;
        }
        return {};
    }

    const AnalogChain& chain() const noexcept { return chain_; }

   private:
    std::string section(const std::string& kind, const std::vector<double>& numbers) {
        const bool butterworth = kind == "butterworth_lowpass" || kind == "butterworth_highpass";
        const bool lead_lag = kind == "lead_lag";
        if (!butterworth && !lead_lag && kind != "lowpass" && kind != "highpass" &&
            kind != "bandpass" && kind != "notch")
            return fmt::format(
                "{} is not a section; use lowpass, highpass, bandpass, notch, lead_lag, "
                "butterworth_lowpass or butterworth_highpass",
                kind);
        if (numbers.size() != 2) {
            const char* form = "FREQUENCY Q";
            if (butterworth) form = "ORDER FREQUENCY";
            if (lead_lag) form = "ZERO_FREQUENCY POLE_FREQUENCY";
            return fmt::format("write {} {}", kind, form);
        }
        if (butterworth) return butterworthSections(kind, numbers[0], numbers[1]);
        if (lead_lag) return leadLag(numbers[0], numbers[1]);
        return resonant(kind, numbers[0], numbers[1]);
    }

    std::string resonant(const std::string& kind, double frequency, double q) {
        if (q < 1e-6 || q > 1e6) return fmt::format("{}: Q = {} is not in 1e-6 to 1e6", kind, q);
        AnalogSection made;
        made.frequency = frequency;
        made.damping = 1.0 / q;
        if (kind == "highpass") made.b = {0.0, 0.0, 1.0};
        if (kind == "bandpass") made.b = {0.0, 1.0, 0.0};
        if (kind == "notch") made.b = {1.0, 0.0, 1.0};
        if (kind == "bandpass" || kind == "notch") made.bandwidth = frequency / q;
        return add(kind, made);
    }

    // (1 + s / zero) / (1 + s / pole): exact at its largest phase, between the two.
    std::string leadLag(double zero, double pole) {
        if (zero <= 0.0 || pole <= 0.0) return "lead_lag: the frequencies must be above 0 Hz";
        const double ratio = std::sqrt(pole / zero);
        return add("lead_lag",
                   {std::sqrt(zero) * std::sqrt(pole), {1.0, ratio, 0.0}, 1.0 / ratio, false});
    }

    std::string butterworthSections(const std::string& kind, double order, double frequency) {
        constexpr double kHighest = 2.0 * static_cast<double>(kMostSections);
        if (order != std::floor(order) || order < 1.0 || order > kHighest)
            return fmt::format("{}: the order {} is not a whole number from 1 to {}", kind, order,
                               kHighest);
        const bool low = kind == "butterworth_lowpass";
        const int whole = static_cast<int>(order);
        // The poles are equally spaced on a circle. Sections with little resonance come first, so
        // that no value between sections is large.
        if (whole % 2 == 1) {
            const AnalogSection first{
                frequency, {low ? 1.0 : 0.0, low ? 0.0 : 1.0, 0.0}, 1.0, false};
            if (std::string error = add(kind, first); !error.empty()) return error;
        }
        for (int i = whole / 2; i >= 1; --i) {
            const double damping = 2.0 * std::sin(kPi * (2 * i - 1) / (2.0 * order));
            const AnalogSection pair{frequency, {low ? 1.0 : 0.0, 0.0, low ? 0.0 : 1.0}, damping};
            if (std::string error = add(kind, pair); !error.empty()) return error;
        }
        return {};
    }

    std::string add(std::string_view kind, const AnalogSection& made) {
        if (made.frequency <= 0.0 || made.frequency >= highest_)
            return fmt::format(
                "{}: {} Hz is not between 0 and {} Hz, 49 % of the component's frequency", kind,
                made.frequency, highest_);
        if (made.bandwidth >= highest_)
            return fmt::format(
                "{}: the bandwidth F / Q = {} Hz is not below {} Hz, 49 % of the component's "
                "frequency: raise Q",
                kind, made.bandwidth, highest_);
        if (chain_.count == kMostSections)
            return fmt::format("at most {} sections; a Butterworth filter has one for two orders",
                               kMostSections);
        chain_.sections[chain_.count++] = made;
        mix(made.frequency);
        for (const double coefficient : made.b) mix(coefficient);
        mix(made.damping);
        mix(made.second_order ? 2.0 : 1.0);
        mix(made.bandwidth);
        return {};
    }

    // FNV-1a, 64 bits at a time.
    void mix(double number) {
        std::uint64_t bits = 0;
        std::memcpy(&bits, &number, sizeof bits);
        chain_.identity = (chain_.identity ^ bits) * 0x100000001b3ULL;
        chain_.identity ^= chain_.identity >> 32U;
    }

    double highest_;
    AnalogChain chain_;
};

// The state of a section is the motion of its filter in continuous time, which the bilinear
// transform, the trapezoidal rule, integrates. It does not depend on the period, so that it stays
// valid when the period changes.
class Biquads final : public rtcf::Component {
    using Motions = std::array<SectionMotion, kMostSections>;

    // Smaller values are set to 0: numbers below 1e-308 would slow down the cycle.
    static constexpr double kSmallest = 1e-200;

    rtcf::Input<double> in{this, "in"};
    rtcf::Output<double> out{this, "out", "", rtcf::Finite()};

    rtcf::Parameter<std::string> sections{
        this, "sections", "",
        rtcf::Doc("sections separated by ;, frequencies F in Hz: lowpass F Q, highpass F Q, "
                  "bandpass F Q, notch F Q, lead_lag F_ZERO F_POLE, butterworth_lowpass ORDER F, "
                  "butterworth_highpass ORDER F")};
    rtcf::Parameter<double> fade{
        this,           "fade",          0.1,
        rtcf::Min(0.0), rtcf::Unit("s"), rtcf::Doc("time of the transition to other sections")};
    rtcf::Parameter<bool> settled{
        this, "settled", true,
        rtcf::Doc("begin as if the first value had always been there; false: as if it had been 0")};

    rtcf::Derived<AnalogChain> analog_{this};
    rtcf::State<std::array<Section, kMostSections>> design_{
        this, "design", {}, rtcf::Doc("coefficients of the sections")};
    rtcf::State<std::uint32_t> count_{this, "count", 0, rtcf::Doc("number of sections")};
    rtcf::State<std::uint64_t> identity_{this, "design_identity", 0,
                                         rtcf::Doc("hash of the sections in the parameter")};
    rtcf::State<std::int64_t> period_{this, "design_period", 0, rtcf::Unit("ns"),
                                      rtcf::Doc("period for which the sections are designed")};
    rtcf::State<Motions> motion_{this, "motion", {}, rtcf::Doc("state of the sections")};
    rtcf::State<double> last_{this, "last", 0.0, rtcf::Doc("output of the sections")};
    rtcf::State<double> offset_{this, "offset", 0.0,
                                rtcf::Doc("difference that a transition adds to the output")};
    rtcf::State<double> fading_{this, "fading", 0.0, rtcf::Unit("s"),
                                rtcf::Doc("time left of the transition")};
    rtcf::State<double> output_{this, "last_output", 0.0, rtcf::Doc("the last output")};
    rtcf::State<bool> begun_{this, "begun", false, rtcf::Doc("the first value has come")};

    bool prepare(const rtcf::Values& proposed) override {
        ChainReader reader(frequency());
        if (const std::string error = reader.read(proposed[sections]); !error.empty())
            return RTCF_FAIL(this, "sections: {}", error);
        analog_.stage(reader.chain());
        return true;
    }

    bool start() override {
        begun_ = false;
        return true;
    }

    void update() override {
        if (in.read() == rtcf::DataStatus::None) return;
        const double x = in.value();
        if (!std::isfinite(x)) {
            out.write(x);  // rejected as not finite: readers keep the last output
            return;
        }
        // The last cycle may be a new period ago, or still an old one, as in a running loop.
        const bool same = identity_ == analog_->identity;
        if (begun_ && same && period_ != period() && elapsed() == period()) design();
        if (!begun_) {
            begin(x);
        } else if (!same) {
            redesign(x);
        }
        Motions next = motion_;
        const double filtered = filter(x, next);
        const double y = filtered + offset_;
        out.write(y);
        if (!std::isfinite(y)) return;  // too large a number: rejected as not finite
        motion_ = next;
        last_ = filtered;
        output_ = y;
        if (period_ != period()) design();
        if (fading_ <= 0.0) return;
        const double left = fading_ - dt();
        offset_ = left > 0.0 ? offset_ * (left / fading_) : 0.0;
        fading_ = std::max(left, 0.0);
    }

    // Runs in the last cycle, too, to pass on the safe command of an upstream component.
    void safe() noexcept override { update(); }

    void begin(double x) {
        design();
        settle(0, settled ? x : 0.0);
        offset_ = 0.0;
        fading_ = 0.0;
        begun_ = true;
    }

    // Gives sections the state that they have after a constant input for a long time.
    void settle(std::size_t first, double input) {
        for (std::size_t i = first; i < count_; ++i) {
            motion_.value()[i] = {input, 0.0, 0.0};
            input *= design_.value()[i].b[0];
        }
    }

    // Designs the sections again. The output continues from the value that it would have without
    // the change.
    void redesign(double x) {
        Motions now = motion_;
        const double expected = filter(x, now) + offset_;
        const std::uint32_t count = count_;
        design();
        if (count_ > count) settle(count, last_);
        now = motion_;
        const double offset = expected - filter(x, now);
        const bool fades = fade > 0.0 && std::isfinite(offset);
        offset_ = fades ? offset : 0.0;
        fading_ = fades ? fade.value() : 0.0;
    }

    void design() {
        const double period_s = 1e-9 * static_cast<double>(period());
        const double highest = kLargestShare / period_s;
        for (std::size_t i = 0; i < analog_->count; ++i) {
            const AnalogSection& section = analog_->sections[i];
            // prepare() has checked them at the period of that time.
            const double most = std::max(section.frequency, section.bandwidth);
            if (most >= highest)
                RTCF_WARN(this, "{} Hz is too high for this loop: {} Hz instead", most, highest);
            design_.value()[i] = discretise(section, std::min(section.frequency, highest),
                                            std::min(section.bandwidth, highest), period_s);
        }
        count_ = static_cast<std::uint32_t>(analog_->count);
        identity_ = analog_->identity;
        period_ = period();
    }

    // Moves the sections by one period. Returns their output.
    double filter(double x, Motions& motions) const {
        for (std::size_t i = 0; i < count_; ++i) {
            const Section& c = design_.value()[i];
            SectionMotion& m = motions[i];
            const double value = m.value + c.k * m.rate;
            if (c.second_order) {
                const double rate = m.rate + c.k * m.acceleration;
                m.acceleration = flushed((x - value - (c.damping + c.k) * rate) /
                                         (1.0 + c.damping * c.k + c.k * c.k));
                m.rate = flushed(rate + c.k * m.acceleration);
            } else {
                m.acceleration = 0.0;
                m.rate = flushed((x - value) / (c.damping + c.k));
            }
            m.value = flushed(value + c.k * m.rate);
            x = c.b[0] * m.value + c.b[1] * m.rate + c.b[2] * m.acceleration;
        }
        return x;
    }

    static double flushed(double value) { return std::abs(value) < kSmallest ? 0.0 : value; }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::Biquads, "Biquads",
                     "Filter of up to 8 second-order sections, by the bilinear transform "
                     "(Oppenheim & Schafer, Discrete-Time Signal Processing, 3rd edition, 2010, "
                     "chapter 7)",
                     Biquads)
