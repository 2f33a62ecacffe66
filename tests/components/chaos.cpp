// A component whose values depend on every detail of the past: on its inputs, the times of its
// reads, and its own values. All of this is declared state, except for a diary that is not read in
// the cycle.
#include <std_msgs/Float64MultiArray.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include <rtcf/component.hpp>
#include <rtcf/eigen_type.hpp>

namespace {

struct Past {
    std::array<double, 3> values{{0.1, 0.2, 0.3}};
    std::uint32_t next = 0;
    template <typename Visit>
    void fields(Visit&& visit) {
        visit("values", values);
        visit("next", next);
    }
};

class Chaos final : public rtcf::Component {
    rtcf::Input<double> a{this, "a"};
    rtcf::Input<double> b{this, "b"};
    rtcf::Input<Eigen::Isometry3d> frame{this, "frame"};
    rtcf::Input<std_msgs::Float64MultiArray> list{this, "list"};
    rtcf::Output<double> x{this, "x"};
    rtcf::Output<double> checked{this, "checked", "", rtcf::Finite()};
    rtcf::Output<Eigen::Isometry3d> turned{this, "turned"};
    rtcf::Output<std_msgs::Float64MultiArray> listed{this, "listed"};
    rtcf::Output<double> low{this, "low"};    // digest after the cycle `ask`: lower
    rtcf::Output<double> high{this, "high"};  // upper 32 bits

    rtcf::Parameter<double> rate{this, "rate", 3.9, rtcf::Min(3.6), rtcf::Max(4.0)};
    rtcf::Parameter<std::int64_t> ask{this, "ask", -1};
    rtcf::Parameter<bool> timed{this, "timed", false, rtcf::Doc("time counts too")};
    rtcf::Derived<double> quarter{this, 3.9 / 4.0};

    rtcf::State<double> value{this, "value", 0.3};
    rtcf::State<std::uint64_t> digest{this, "digest", 1};
    rtcf::State<Past> past{this, "past", {}};

    static constexpr std::size_t kDiary = std::size_t{1} << 17;
    std::vector<std::uint64_t> diary_;  // digests by cycle

    bool prepare(const rtcf::Values& proposed) override {
        quarter.stage(proposed[rate] / 4.0);
        return true;
    }

    bool configure() override {
        diary_.resize(kDiary);
        std_msgs::Float64MultiArray largest;
        largest.data.resize(4);
        listed.reserve(largest);
        return true;
    }

    void note(double number) {
        std::uint64_t bits = 0;
        std::memcpy(&bits, &number, sizeof bits);
        digest = (digest.value() ^ bits) * 6364136223846793005U + 1442695040888963407U;
    }

    // Adds the value read, and its status.
    template <typename T>
    bool readAny(rtcf::Input<T>& input) {
        const rtcf::DataStatus status = input.read();
        note(static_cast<double>(status));
        if (timed) note(static_cast<double>(input.age(this)));
        return status != rtcf::DataStatus::None;
    }

    void update() override {
        double sum = 4.0 * quarter.value() * value * (1.0 - value);
        if (readAny(a)) sum += a.value();
        if (readAny(b)) sum += 0.5 * b.value();
        if (readAny(frame)) sum += std::abs(frame.value().linear()(0, 1));
        if (readAny(list)) {
            for (const double each : list.value().data) note(each);
        }
        sum += past->values[past->next];
        value = 0.05 + 0.9 * (sum - std::floor(sum));
        past->values[past->next] = value;
        past->next = (past->next + 1) % 3;
        note(value);
        if (timed) {
            note(static_cast<double>(time()));
            note(static_cast<double>(stamp()));
            note(static_cast<double>(iteration()));
            note(static_cast<double>(elapsed()));
        }
        writeSome();
        diary_[iteration() % kDiary] = digest;
        if (ask >= 0) {
            const std::uint64_t told = diary_[static_cast<std::size_t>(ask) % kDiary];
            low.write(static_cast<double>(told & 0xffffffffU));
            high.write(static_cast<double>(told >> 32U));
        }
    }

    // Writes different outputs in different cycles.
    void writeSome() {
        if ((digest >> 40U) % 3 != 0) x.write(value);
        if ((digest >> 42U) % 4 != 0) checked.write(1.0 - value);
        if ((digest >> 44U) % 2 != 0) {
            turned.value() = Eigen::AngleAxisd(value, Eigen::Vector3d::UnitX()) *
                             Eigen::Translation3d(value, 0.0, 1.0);
            turned.value().rotate(Eigen::AngleAxisd(1.0 - value, Eigen::Vector3d::UnitZ()));
            if ((digest >> 46U) % 3 != 0) turned.publish();
        }
        if ((digest >> 48U) % 5 == 0) {
            listed.value().data.resize((digest >> 50U) % 5);
            for (double& each : listed.value().data) each = value;
            listed.publish();
        }
    }
};

}  // namespace

RTCF_COMPONENT(Chaos, "Computes a digest of all past inputs")
