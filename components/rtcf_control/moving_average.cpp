#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <rtcf/component.hpp>

namespace rtcf_control {
namespace {

class MovingAverage final : public rtcf::Component {
    // Each frame of the runner contains the window, see frame_kb in rtcfd.toml(5).
    static constexpr std::int32_t kLongest = 1000;

    rtcf::Input<double> in{this, "in"};
    rtcf::Output<double> out{this, "out", "", rtcf::Finite()};

    rtcf::Parameter<std::int32_t> length{this,
                                         "length",
                                         10,
                                         rtcf::Min(1.0),
                                         rtcf::Max(kLongest),
                                         rtcf::Unit("cycles"),
                                         rtcf::Doc("length of the window")};

    rtcf::State<std::array<double, kLongest>> window_{this, "window", {}};
    rtcf::State<std::int32_t> count_{this, "count", 0, rtcf::Doc("values in the window")};
    rtcf::State<std::int32_t> next_{this, "next", 0, rtcf::Doc("place of the next value")};
    rtcf::State<std::int32_t> ring_{this, "ring", 0, rtcf::Doc("number of places in use")};
    rtcf::State<double> sum_{this, "sum", 0.0, rtcf::Doc("sum of the window")};
    rtcf::State<double> round_{this, "round", 0.0, rtcf::Doc("sum of the places before next")};

    bool start() override {
        count_ = 0;
        return true;
    }

    void update() override {
        if (in.read() == rtcf::DataStatus::None) return;
        const double value = in.value();
        if (!std::isfinite(value)) {
            out.write(value);  // rejected as not finite: readers keep the last output
            return;
        }
        // State that was handed over or set by hand may not fit.
        const bool fits = ring_ >= 1 && ring_ <= kLongest && count_ >= 1 && count_ <= ring_ &&
                          next_ >= 0 && next_ < ring_;
        if (!fits) {
            restart();
        } else if (ring_ != length) {
            resize();
        }
        auto& window = window_.value();
        const auto place = static_cast<std::size_t>(next_.value());
        if (count_ == ring_) {
            sum_ -= window[place];
        } else {
            count_ += 1;
        }
        window[place] = value;
        sum_ += value;
        round_ += value;
        next_ += 1;
        if (next_ == ring_) {
            // The running sum collects rounding errors: replace it by the sum of this round.
            sum_ = round_.value();
            round_ = 0.0;
            next_ = 0;
        }
        out.write(sum_ / count_);
    }

    // Runs in the last cycle, too, to pass on the safe command of an upstream component.
    void safe() noexcept override { update(); }

    void restart() {
        ring_ = length.value();
        count_ = 0;
        next_ = 0;
        sum_ = 0.0;
        round_ = 0.0;
    }

    // Another length: the window keeps its mean, so that the output does not jump.
    void resize() {
        const double mean = sum_ / count_;
        const std::int32_t kept = std::min(count_.value(), length.value());
        restart();
        std::fill_n(window_.value().begin(), kept, mean);
        count_ = kept;
        sum_ = mean * kept;
        next_ = kept == ring_ ? 0 : kept;
        round_ = next_ == 0 ? 0.0 : sum_.value();
    }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::MovingAverage, "MovingAverage",
                     "Mean of the last values; while the window is not full, of all values",
                     MovingAverage)
