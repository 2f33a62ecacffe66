// As notch_bank.py.
#include <array>
#include <cmath>
#include <cstddef>
#include <rtcf/component.hpp>
#include <rtcf/eigen_type.hpp>

namespace {

constexpr double kNotchPeriod = 0.001;  // s
constexpr std::size_t kNotchJoints = 8;
constexpr std::size_t kNotchSections = 4;

using Joints = Eigen::Array<double, kNotchJoints, 1>;
using JointsValue = Eigen::Matrix<double, kNotchJoints, 1>;
using NotchValues = std::array<double, 5>;  // b0, b1, b2, a1, a2

NotchValues notchOf(double frequency, double q) {
    const double w = 2.0 * M_PI * frequency * kNotchPeriod;
    const double alpha = std::sin(w) / (2.0 * q);
    const double middle = -2.0 * std::cos(w) / (1.0 + alpha);
    return {1.0 / (1.0 + alpha), middle, 1.0 / (1.0 + alpha), middle,
            (1.0 - alpha) / (1.0 + alpha)};
}

double notchFrequency(std::size_t number) { return 20.0 + 10.0 * static_cast<double>(number); }

// One notch per joint, with vectors of the joints.
class NotchRows final : public rtcf::Component {
    rtcf::Input<JointsValue> u{this, "u"};
    rtcf::Output<JointsValue> y{this, "y"};
    rtcf::Parameter<double> q{this, "q", 5.0, rtcf::Min(0.1), rtcf::Doc("quality factor")};
    rtcf::Derived<std::array<Joints, 5>> c{this};
    rtcf::State<std::array<JointsValue, 2>> z{
        this, "z", {JointsValue(JointsValue::Zero()), JointsValue(JointsValue::Zero())}};

    bool prepare(const rtcf::Values& proposed) override {
        std::array<Joints, 5> next;
        for (std::size_t k = 0; k < kNotchJoints; ++k) {
            const NotchValues found = notchOf(notchFrequency(k), proposed[q]);
            for (std::size_t i = 0; i < found.size(); ++i)
                next[i][static_cast<Eigen::Index>(k)] = found[i];
        }
        c.stage(next);
        return true;
    }

    void update() override {
        u.read();
        const Joints x = u.value().array();
        const std::array<Joints, 5>& b = *c;
        std::array<JointsValue, 2>& kept = z.value();
        const Joints out = b[0] * x + kept[0].array();
        kept[0] = b[1] * x - b[3] * out + kept[1].array();
        kept[1] = b[2] * x - b[4] * out;
        y.write(out.matrix());
    }
};
RTCF_COMPONENT(NotchRows, "One notch per joint")

// The same with the filter of a joint in one place.
class NotchColumns final : public rtcf::Component {
    rtcf::Input<JointsValue> u{this, "u"};
    rtcf::Output<JointsValue> y{this, "y"};
    rtcf::Parameter<double> q{this, "q", 5.0, rtcf::Min(0.1), rtcf::Doc("quality factor")};
    rtcf::Derived<std::array<NotchValues, kNotchJoints>> c{this};
    std::array<std::array<double, 2>, kNotchJoints> z{};

    bool prepare(const rtcf::Values& proposed) override {
        std::array<NotchValues, kNotchJoints> next;
        for (std::size_t k = 0; k < kNotchJoints; ++k)
            next[k] = notchOf(notchFrequency(k), proposed[q]);
        c.stage(next);
        return true;
    }

    void update() override {
        u.read();
        const JointsValue& x = u.value();
        JointsValue out;
        for (std::size_t k = 0; k < kNotchJoints; ++k) {
            const NotchValues& b = c->at(k);
            std::array<double, 2>& kept = z[k];
            const double in = x[static_cast<Eigen::Index>(k)];
            const double filtered = b[0] * in + kept[0];
            kept[0] = b[1] * in - b[3] * filtered + kept[1];
            kept[1] = b[2] * in - b[4] * filtered;
            out[static_cast<Eigen::Index>(k)] = filtered;
        }
        y.write(out);
    }
};
RTCF_COMPONENT(NotchColumns, "One notch per joint")

// Notches in series for all joints.
class NotchSections final : public rtcf::Component {
    struct Section {
        JointsValue first = JointsValue::Zero();
        JointsValue second = JointsValue::Zero();
    };

    rtcf::Input<JointsValue> u{this, "u"};
    rtcf::Output<JointsValue> y{this, "y"};
    rtcf::Parameter<double> q{this, "q", 5.0, rtcf::Min(0.1), rtcf::Doc("quality factor")};
    rtcf::Derived<std::array<NotchValues, kNotchSections>> c{this};
    std::array<Section, kNotchSections> z;

    bool prepare(const rtcf::Values& proposed) override {
        std::array<NotchValues, kNotchSections> next;
        for (std::size_t k = 0; k < kNotchSections; ++k)
            next[k] = notchOf(notchFrequency(k), proposed[q]);
        c.stage(next);
        return true;
    }

    void update() override {
        u.read();
        Joints x = u.value().array();
        for (std::size_t k = 0; k < kNotchSections; ++k) {
            const NotchValues& b = c->at(k);
            Section& kept = z[k];
            const Joints out = b[0] * x + kept.first.array();
            kept.first = b[1] * x - b[3] * out + kept.second.array();
            kept.second = b[2] * x - b[4] * out;
            x = out;
        }
        y.write(x.matrix());
    }
};
RTCF_COMPONENT(NotchSections, "Notches in series for all joints")

// Notches in series for one signal.
class NotchCascade final : public rtcf::Component {
    rtcf::Input<double> u{this, "u"};
    rtcf::Output<double> y{this, "y"};
    rtcf::Parameter<double> q{this, "q", 5.0, rtcf::Min(0.1), rtcf::Doc("quality factor")};
    rtcf::Derived<std::array<NotchValues, kNotchJoints>> c{this};
    std::array<std::array<double, 2>, kNotchJoints> z{};

    bool prepare(const rtcf::Values& proposed) override {
        std::array<NotchValues, kNotchJoints> next;
        for (std::size_t k = 0; k < kNotchJoints; ++k)
            next[k] = notchOf(notchFrequency(k), proposed[q]);
        c.stage(next);
        return true;
    }

    void update() override {
        u.read();
        double x = u.value();
        for (std::size_t k = 0; k < kNotchJoints; ++k) {
            const NotchValues& b = c->at(k);
            std::array<double, 2>& kept = z[k];
            const double out = b[0] * x + kept[0];
            kept[0] = b[1] * x - b[3] * out + kept[1];
            kept[1] = b[2] * x - b[4] * out;
            x = out;
        }
        y.write(x);
    }
};
RTCF_COMPONENT(NotchCascade, "Notches in series for one signal")

}  // namespace
