// As components/rtcf_examples/python/ring_buffer.py.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <rtcf/component.hpp>
#include <rtcf/eigen_type.hpp>

namespace {

constexpr int kValues = 100;
constexpr int kTaps = 8;

using Values = Eigen::Matrix<double, kValues, 1>;
using Taps = Eigen::Matrix<double, kTaps, 1>;

// The inner part of a Hann window with sum one.
Taps window() {
    Taps result;
    for (int i = 0; i < kTaps; ++i)
        result[i] = 0.5 - 0.5 * std::cos(2.0 * M_PI * (i + 1) / (kTaps + 1));
    return result / result.sum();
}

class RingBuffer final : public rtcf::Component {
    rtcf::Input<double> u{this, "u"};
    rtcf::Output<double> mean{this, "mean"};
    rtcf::Output<double> deviation{this, "deviation"};
    rtcf::Output<Eigen::Vector2d> span{this, "span"};
    rtcf::Output<double> median{this, "median"};
    rtcf::Output<double> smooth{this, "smooth"};
    rtcf::Output<std::int64_t> peak{this, "peak"};
    rtcf::State<Values> values{this, "values", Values(Values::Zero())};
    rtcf::State<Taps> taps{this, "taps", Taps(Taps::Zero())};
    rtcf::State<std::int64_t> count{this, "count", 0};
    Taps weights = window();

    void update() override {
        if (u.read() != rtcf::DataStatus::New) return;
        values.value()[count % kValues] = u.value();
        count += 1;
        Taps& lately = taps.value();
        for (int i = kTaps - 1; i > 0; --i) lately[i] = lately[i - 1];
        lately[0] = u.value();

        const Eigen::Index size = std::min<Eigen::Index>(count, kValues);
        const auto known = values.value().head(size);
        const double average = known.mean();
        mean.write(average);
        deviation.write(
            std::sqrt((known.array() - average).square().sum() / static_cast<double>(size)));
        span.write(Eigen::Vector2d(known.minCoeff(), known.maxCoeff()));
        std::array<double, kValues> ordered;
        std::copy(known.begin(), known.end(), ordered.begin());
        std::sort(ordered.begin(), ordered.begin() + size);
        const auto half = static_cast<std::size_t>(size / 2);
        median.write(size % 2 != 0 ? ordered[half] : (ordered[half - 1] + ordered[half]) / 2.0);
        smooth.write(weights.dot(lately));
        Eigen::Index largest = 0;
        known.cwiseAbs().maxCoeff(&largest);
        peak.write(largest);
    }
};
RTCF_COMPONENT(RingBuffer, "Statistics of the latest values of a signal")

}  // namespace
