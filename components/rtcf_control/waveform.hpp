/// @file
/// The signals of SignalGenerator and Excitation. The component owns the state of the signal and
/// calls the functions in each cycle.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>

#include <rtcf/component.hpp>
#include <rtcf/design_period.hpp>

namespace rtcf_control {

/// Form of a signal.
enum class Shape { Step, Ramp, Sine, Square, Triangle, LinearChirp, LogChirp, Prbs, Multisine };

constexpr double kTurn = 6.28318530717958647692;  ///< 2 pi
/// Phases closer than this to an edge count as on it: sums of rounded steps miss it by less.
constexpr double kPhaseTolerance = 1e-9;
/// First state of the shift register of PRBS: of all states, the one from which the sum of the
/// first n bits stays within the square root of n for the longest time, 25808 bits.
constexpr std::uint32_t kPrbsStart = 0x1DF7;

/// The sum of `lines` sines, multiples of the frequency, with the phases of Schroeder (Synthesis of
/// low-peak-factor signals, IEEE Transactions on Information Theory, 1970), which keep its peak
/// low. Real-time safe.
inline double multisine(int lines, double phase) noexcept {
    double sum = 0.0;
    for (int k = 1; k <= lines; ++k)
        sum += std::sin(kTurn * k * phase - kTurn / 2.0 * k * (k - 1) / lines);
    return sum;
}

/// Largest absolute value of this sum. Not real-time: takes some ms.
inline double peakOfMultisine(int lines) {
    const int points = 256 * lines;
    double peak = 0.0;
    for (int i = 0; i < points; ++i)
        peak = std::max(peak, std::abs(multisine(lines, static_cast<double>(i) / points)));
    return peak;
}

/// Nanoseconds of a time in s.
inline std::int64_t nanoseconds(double seconds) noexcept { return std::llround(seconds * 1e9); }

/// A signal, from the parameters of its component.
struct Waveform {
    Shape shape = Shape::Sine;
    double frequency = 1.0;      ///< Hz; of a chirp the first, of a PRBS the bits per second
    double end_frequency = 1.0;  ///< Hz, of a chirp
    double duration = 1.0;       ///< s, of a ramp or chirp
    double delay = 0.0;          ///< s, before a step or ramp
    int lines = 1;               ///< of a multisine
    double peak = 1.0;           ///< peakOfMultisine(lines)

    bool chirps() const noexcept { return shape == Shape::LinearChirp || shape == Shape::LogChirp; }

    /// Whether another signal has the same frequencies.
    bool hasFrequenciesOf(const Waveform& other) const noexcept {
        return shape == other.shape && frequency == other.frequency &&
               end_frequency == other.end_frequency && lines == other.lines;
    }

    /// Why the frequencies do not fit the shape; null if they do.
    const char* frequencyError() const noexcept {
        const bool is_wrong =
            shape == Shape::LogChirp && (frequency <= 0.0 || end_frequency <= 0.0);
        return is_wrong ? "log_chirp: frequency and end_frequency must be above 0 Hz" : nullptr;
    }

    /// Why a component with this frequency, Hz, cannot play the signal: sampled values alias above
    /// half of it. Empty if it can. Not real-time safe.
    std::string samplingError(double component_hz) const {
        double highest = frequency;
        double limit = component_hz / 2.0;
        if (shape == Shape::Step || shape == Shape::Ramp) return {};
        if (shape == Shape::Prbs) {
            if (frequency <= component_hz * (1.0 + kPhaseTolerance)) return {};
            return fmt::format("a PRBS of {} bits per second has one bit per cycle, {} per second",
                               frequency, component_hz);
        }
        if (chirps()) highest = std::max(frequency, end_frequency);
        if (shape == Shape::Multisine) highest = frequency * lines;
        // A square wave of half the component's frequency changes its sign in each cycle.
        if (shape == Shape::Square) limit *= 1.0 + kPhaseTolerance;
        if (highest < limit) return {};
        return fmt::format(
            "the highest frequency, {} Hz, is not below {} Hz, half of the component's", highest,
            component_hz / 2.0);
    }

    /// Turns of a chirp from its start to a time, s. Real-time safe.
    double turns(double time) const noexcept {
        if (shape == Shape::LinearChirp)
            return time * (frequency + (end_frequency - frequency) * time / (2.0 * duration));
        const double ratio = std::log(end_frequency / frequency);
        return ratio == 0.0 ? frequency * time
                            : frequency * duration / ratio * std::expm1(ratio * time / duration);
    }
};

/// Why a component must not get a signal; empty if it may. Logs errors that are permitted: of a
/// loop that becomes slower, and of a PRBS. In prepare(); not real-time safe.
/// @param present signal of the component; null before configure()
inline std::string proposalError(const rtcf::Component* owner, const Waveform& next,
                                 const Waveform* present, const rtcf::DesignPeriod& period) {
    constexpr const char* kAdvice =
        "lower frequency, end_frequency or lines, or raise the loop's frequency";
    const std::string error = next.samplingError(1e9 / static_cast<double>(period.proposed()));
    if (error.empty()) return {};
    const bool is_new = present == nullptr || !next.hasFrequenciesOf(*present);
    if (is_new && next.shape != Shape::Prbs) return error + ": " + kAdvice;
    if (is_new || period.proposed() != owner->period()) RTCF_WARN(owner, "{}: {}", error, kAdvice);
    return {};
}

/// A running signal: refers to the state of its component. All functions are real-time safe.
struct WaveState {
    bool& begun;          ///< the first value has been played
    std::int64_t& time;   ///< of the last value, ns since the signal began
    double& phase;        ///< of the wave, 0 to 1
    std::uint32_t& bits;  ///< shift register of PRBS

    void restart() const noexcept {
        begun = false;
        time = 0;
        phase = 0.0;
        bits = kPrbsStart;
    }

    /// Value of the signal in this cycle, `elapsed` ns after the last one, between -1 and 1.
    double next(const Waveform& wave, std::int64_t elapsed) const noexcept {
        if (begun) advance(wave, elapsed);
        begun = true;
        return value(wave);
    }

   private:
    double value(const Waveform& wave) const noexcept {
        const std::int64_t since = time - nanoseconds(wave.delay);
        switch (wave.shape) {
            case Shape::Step:
                return since >= 0 ? 1.0 : 0.0;
            case Shape::Ramp:
                return std::clamp(1e-9 * static_cast<double>(since) / wave.duration, 0.0, 1.0);
            case Shape::Sine:
            case Shape::LinearChirp:
            case Shape::LogChirp:
                return std::sin(kTurn * phase);
            case Shape::Square:
                return phase < 0.5 - kPhaseTolerance ? 1.0 : -1.0;
            case Shape::Triangle:
                // From 0 to 1, -1 and 0, as a sine.
                return 1.0 - 4.0 * std::abs(std::fmod(phase + 0.25, 1.0) - 0.5);
            case Shape::Prbs:
                return (bits & 1U) != 0U ? 1.0 : -1.0;
            case Shape::Multisine:
                return std::clamp(multisine(wave.lines, phase) / wave.peak, -1.0, 1.0);
        }
        return 0.0;
    }

    // A chirp begins again at its end.
    void advance(const Waveform& wave, std::int64_t elapsed) const noexcept {
        const double before = 1e-9 * static_cast<double>(time);
        time += elapsed;
        if (wave.chirps() && time >= nanoseconds(wave.duration)) {
            time = 0;
            phase = 0.0;
            return;
        }
        phase += wave.chirps() ? wave.turns(1e-9 * static_cast<double>(time)) - wave.turns(before)
                               : wave.frequency * (1e-9 * static_cast<double>(elapsed));
        const double whole = std::floor(phase + kPhaseTolerance);
        phase -= whole;
        // At most one new bit a cycle. x^15 + x^14 + 1 has the period 32767.
        if (wave.shape == Shape::Prbs && whole > 0.0) {
            const std::uint32_t bit = ((bits >> 14U) ^ (bits >> 13U)) & 1U;
            bits = ((bits << 1U) | bit) & 0x7FFFU;
            if (bits == 0U) bits = kPrbsStart;
        }
    }
};

}  // namespace rtcf_control
