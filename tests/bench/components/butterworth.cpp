// As components/rtcf_examples/python/butterworth.py.
#include <array>
#include <cmath>
#include <cstddef>
#include <rtcf/component.hpp>
#include <rtcf/eigen_type.hpp>

namespace {

constexpr double kPeriod = 0.001;  // s
constexpr int kOrder = 4;
constexpr int kSections = kOrder / 2;

class Butterworth final : public rtcf::Component {
    struct Section {
        Eigen::Vector3d b;
        Eigen::Vector2d a;
    };

    rtcf::Input<double> u{this, "u"};
    rtcf::Output<double> y{this, "y"};
    rtcf::Parameter<double> cutoff{this,           "cutoff",         50.0,
                                   rtcf::Min(0.1), rtcf::Max(450.0), rtcf::Unit("Hz")};
    rtcf::Derived<std::array<Section, kSections>> sections{this};
    rtcf::State<std::array<Eigen::Vector2d, kSections>> past{
        this, "past", {Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero()}};

    bool prepare(const rtcf::Values& proposed) override {
        const double w = std::tan(M_PI * proposed[cutoff] * kPeriod);
        std::array<Section, kSections> next;
        for (int i = 0; i < kSections; ++i) {
            const double damping = 2.0 * std::cos(M_PI * (2 * i + 1) / (2 * kOrder));
            const double norm = 1.0 + damping * w + w * w;
            Section& section = next[static_cast<std::size_t>(i)];
            section.b = Eigen::Vector3d(w * w, 2.0 * w * w, w * w) / norm;
            section.a = Eigen::Vector2d(2.0 * (w * w - 1.0), 1.0 - damping * w + w * w) / norm;
        }
        sections.stage(next);
        return true;
    }

    void update() override {
        u.read();
        double x = u.value();
        for (std::size_t i = 0; i < kSections; ++i) {
            const Section& section = sections->at(i);
            Eigen::Vector2d& kept = past.value()[i];
            const double out = section.b[0] * x + kept[0];
            kept[0] = section.b[1] * x - section.a[0] * out + kept[1];
            kept[1] = section.b[2] * x - section.a[1] * out;
            x = out;
        }
        y.write(x);
    }
};
RTCF_COMPONENT(Butterworth, "Low-pass filter")

}  // namespace
