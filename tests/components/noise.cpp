// Its values are a pseudorandom function of the cycle number, so that a test can compute the
// expected content of a stream.
#include <cmath>
#include <cstdint>
#include <limits>

#include <rtcf/component.hpp>

namespace {

class Noise final : public rtcf::Component {
    rtcf::Output<double> out{this, "out"};
    rtcf::Output<double> gaps{this, "gaps"};
    rtcf::State<std::int32_t> steps{this, "steps", 0};

    // SplitMix64.
    static std::uint64_t mixed(std::uint64_t number) {
        number += 0x9e3779b97f4a7c15;
        number = (number ^ (number >> 30U)) * 0xbf58476d1ce4e5b9;
        number = (number ^ (number >> 27U)) * 0x94d049bb133111eb;
        return number ^ (number >> 31U);
    }

    void update() override {
        const std::uint64_t random = mixed(iteration());
        const double value = static_cast<double>(random >> 11U) * 0x1p-52 - 1.0;
        out.write(value);
        gaps.write(random % 500 == 0 ? std::numeric_limits<double>::quiet_NaN() : value);
        steps = static_cast<std::int32_t>(random % 5);
    }
};

}  // namespace

RTCF_COMPONENT(Noise, "Has pseudorandom values that depend on the cycle number")
