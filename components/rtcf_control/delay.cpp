#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <rtcf/component.hpp>

namespace rtcf_control {
namespace {

// The output is `initial` from the first cycle on, even if the input has no value, so that a loop
// can be closed over a delay.
class Delay final : public rtcf::Component {
    static constexpr std::size_t kSize = 1001;

    rtcf::Input<double> in{this, "in"};
    rtcf::Output<double> out{this, "out", "", rtcf::Finite()};

    rtcf::Parameter<double> delay{this,
                                  "delay",
                                  0.0,
                                  rtcf::Min(0.0),
                                  rtcf::Max(1e6),
                                  rtcf::Unit("s"),
                                  rtcf::Doc("delay, at most 1000 cycles")};
    rtcf::Parameter<double> initial{this, "initial", 0.0,
                                    rtcf::Doc("output until the first value has passed")};

    // A ring of the last values, and their times since the start. Each frame of the runner contains
    // it, see frame_kb in rtcfd.toml(5).
    rtcf::State<std::array<double, kSize>> values_{this, "values", {}};
    rtcf::State<std::array<std::int64_t, kSize>> times_{this, "times", {}, rtcf::Unit("ns")};
    rtcf::State<std::uint64_t> count_{this, "count", 0, rtcf::Doc("values so far")};
    rtcf::State<std::int64_t> now_{this, "now", 0, rtcf::Unit("ns"),
                                   rtcf::Doc("time since the start")};

    bool prepare(const rtcf::Values& proposed) override {
        if (nanoseconds(proposed[delay]) <= longest()) return true;
        return RTCF_FAIL(this, "delay = {} s is above 1000 cycles, which are {} s at {} Hz",
                         proposed[delay], 1e-9 * static_cast<double>(longest()), frequency());
    }

    bool start() override {
        count_ = 0;
        now_ = 0;
        return true;
    }

    void update() override {
        now_ += elapsed();
        if (in.read() == rtcf::DataStatus::None) {
            out.write(initial);
            return;
        }
        const double value = in.value();
        if (!std::isfinite(value)) {
            out.write(value);  // rejected as not finite: readers keep the last output
            return;
        }
        values_.value()[count_ % kSize] = value;
        times_.value()[count_ % kSize] = now_;
        count_ += 1;
        // prepare() has checked the delay, but the frequency may have changed since then.
        if (nanoseconds(delay) > longest())
            RTCF_WARN_THROTTLE(this, 10.0, "delay is only {} s: at most 1000 cycles at {} Hz",
                               1e-9 * static_cast<double>(longest()), frequency());
        out.write(valueAt(now_ - nanoseconds(delay)));
    }

    // Runs in the last cycle, too, to pass on the safe command of an upstream component.
    void safe() noexcept override { update(); }

    static std::int64_t nanoseconds(double seconds) { return std::llround(seconds * 1e9); }
    std::int64_t longest() const { return (static_cast<std::int64_t>(kSize) - 1) * period(); }

    // Interpolates linearly between two cycles. If the ring is too short for the delay, the result
    // is the oldest value in it.
    double valueAt(std::int64_t time) const {
        const auto& times = times_.value();
        const auto& values = values_.value();
        std::uint64_t low = count_ > kSize ? count_ - kSize : 0;
        std::uint64_t high = count_ - 1;
        if (time < times[low % kSize])
            return count_ > kSize ? values[low % kSize] : initial.value();
        if (time >= times[high % kSize]) return values[high % kSize];
        while (high - low > 1) {
            const std::uint64_t middle = low + (high - low) / 2;
            (times[middle % kSize] <= time ? low : high) = middle;
        }
        const std::int64_t before = times[low % kSize];
        const double share =
            static_cast<double>(time - before) / static_cast<double>(times[high % kSize] - before);
        return values[low % kSize] + share * (values[high % kSize] - values[low % kSize]);
    }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::Delay, "Delay",
                     "Delays a value by a time, linear between cycles", Delay)
