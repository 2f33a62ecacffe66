// Has glitches of one cycle, for streams that send only some cycles.
#include <cstdint>

#include <Eigen/Core>
#include <rtcf/component.hpp>
#include <rtcf/eigen_type.hpp>

namespace {

class Glitch final : public rtcf::Component {
    rtcf::Output<double> out{this, "out"};
    rtcf::Output<Eigen::Vector3d> three{this, "three"};
    rtcf::State<std::int32_t> state{this, "state", 0};
    std::uint64_t random_ = 88172645463325252;

    // A different cycle of each thousand.
    void update() override {
        if (iteration() % 1000 == 0) {
            random_ ^= random_ << 13;
            random_ ^= random_ >> 7;
            random_ ^= random_ << 17;
        }
        const bool here = iteration() % 1000 == random_ % 1000;
        const auto slow = static_cast<double>(iteration() % 7);
        out.write(here ? 1000.0 : slow);
        three.write(Eigen::Vector3d(slow, here ? -5.0 : 1.0, 2.0));
        state = here ? -7 : static_cast<std::int32_t>(iteration() % 3);
    }
};

}  // namespace

RTCF_COMPONENT(Glitch, "Has glitches of one cycle")
