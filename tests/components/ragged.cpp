// Signals that a plot must show: spikes of one cycle, ranges of NaN, and small changes of a large
// value.
#include <cmath>
#include <cstdint>
#include <limits>

#include <rtcf/component.hpp>

namespace {

class Ragged final : public rtcf::Component {
    rtcf::Output<double> spikes{this, "spikes"};
    rtcf::Output<double> holes{this, "holes"};
    rtcf::Output<double> large{this, "large"};
    rtcf::Parameter<std::int32_t> seed{this, "seed", 1, rtcf::Doc("of the spikes and the holes")};
    std::uint64_t random_ = 0;
    std::uint64_t hole_until_ = 0;

    std::uint64_t draw(std::uint64_t below) {
        random_ ^= random_ << 13;
        random_ ^= random_ >> 7;
        random_ ^= random_ << 17;
        return random_ % below;
    }

    void update() override {
        constexpr double kTurn = 6.283185307179586;
        constexpr std::uint64_t kSpikes = 150, kHoles = 1500, kLongest = 400;
        if (random_ == 0) random_ = 88172645463325252U + static_cast<std::uint64_t>(seed.value());
        const double time = static_cast<double>(iteration()) / frequency();
        const double wave = std::sin(kTurn * time);
        spikes.write(draw(kSpikes) == 0 ? 3.0 : 0.5 * wave);
        if (draw(kHoles) == 0) hole_until_ = iteration() + draw(kLongest);
        holes.write(iteration() < hole_until_ ? std::numeric_limits<double>::quiet_NaN() : wave);
        large.write(1.3702e6 + 100.0 * wave);
    }
};

}  // namespace

RTCF_COMPONENT(Ragged, "Has spikes, holes and small changes of a large value")
