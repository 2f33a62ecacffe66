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

    // Values are added only: a large one would leave rounding errors behind when it is subtracted.
    rtcf::State<std::array<double, kLongest>> window_{
        this,
        "window",
        {},
        rtcf::Doc("before next: values of this round; from there on: sums of the last round's "
                  "values from each place to the end")};
    rtcf::State<std::int32_t> count_{this, "count", 0, rtcf::Doc("values in the window")};
    rtcf::State<std::int32_t> next_{this, "next", 0, rtcf::Doc("place of the next value")};
    rtcf::State<std::int32_t> ring_{this, "ring", 0, rtcf::Doc("number of places in use")};
    rtcf::State<double> round_{this, "round", 0.0, rtcf::Doc("sum of this round's values")};

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
        window_.value()[static_cast<std::size_t>(next_.value())] = value;
        round_ += value;
        next_ += 1;
        count_ = std::min(count_ + 1, ring_.value());
        const double sum = this->sum();
        if (next_ == ring_) endRound();
        out.write(sum / count_);
    }

    // Runs in the last cycle, too, to pass on the safe command of an upstream component.
    void safe() noexcept override { update(); }

    // Of the values in the window.
    double sum() const {
        const bool has_rest = count_ == ring_ && next_ < ring_;
        return has_rest ? round_ + window_.value()[static_cast<std::size_t>(next_.value())]
                        : round_.value();
    }

    void endRound() {
        auto& window = window_.value();
        for (auto i = static_cast<std::size_t>(ring_.value()) - 1; i > 0; --i)
            window[i - 1] += window[i];
        round_ = 0.0;
        next_ = 0;
    }

    void restart() {
        ring_ = length.value();
        count_ = 0;
        next_ = 0;
        round_ = 0.0;
    }

    // Another length: the window keeps its mean, so that the output does not jump.
    void resize() {
        const double mean = sum() / count_;
        const std::int32_t kept = std::min(count_.value(), length.value());
        restart();
        std::fill_n(window_.value().begin(), kept, mean);
        count_ = kept;
        next_ = kept;
        round_ = mean * kept;
        if (next_ == ring_) endRound();
    }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::MovingAverage, "MovingAverage",
                     "Mean of the last values; while the window is not full, of all values",
                     MovingAverage)
