// As components/rtcf_examples/python/lqr.py.
#include <algorithm>
#include <rtcf/component.hpp>
#include <rtcf/eigen_type.hpp>

namespace {

constexpr double kGravity = 9.81;
constexpr double kLength = 0.5;
constexpr double kMass = 0.2;
constexpr double kCart = 1.0;
constexpr double kPeriod = 0.001;

class Lqr final : public rtcf::Component {
    rtcf::Input<Eigen::Vector4d> state{this, "state"};
    rtcf::Input<double> reference{this, "reference"};
    rtcf::Output<double> force{this, "force", "N", rtcf::Finite()};
    rtcf::Parameter<double> weights_0{this, "weights_0", 10.0};
    rtcf::Parameter<double> weights_1{this, "weights_1", 1.0};
    rtcf::Parameter<double> weights_2{this, "weights_2", 100.0};
    rtcf::Parameter<double> weights_3{this, "weights_3", 1.0};
    rtcf::Parameter<double> effort{this, "effort", 0.1, rtcf::Min(1e-6)};
    rtcf::Parameter<double> largest{this, "largest", 20.0, rtcf::Min(0.0), rtcf::Unit("N")};
    rtcf::Derived<Eigen::Vector4d> gain{this};

    bool prepare(const rtcf::Values& proposed) override {
        Eigen::Matrix4d system = Eigen::Matrix4d::Zero();
        system(0, 1) = 1.0;
        system(1, 2) = -kMass * kGravity / kCart;
        system(2, 3) = 1.0;
        system(3, 2) = (kCart + kMass) * kGravity / (kCart * kLength);
        const Eigen::Vector4d input(0.0, 1.0 / kCart, 0.0, -1.0 / (kCart * kLength));
        const Eigen::Matrix4d identity = Eigen::Matrix4d::Identity();
        const double half = kPeriod * kPeriod / 2.0;
        const Eigen::Matrix4d a = identity + system * kPeriod + system * system * half;
        const Eigen::Vector4d b = (identity * kPeriod + system * half) * input;
        const Eigen::Vector4d weights(proposed[weights_0], proposed[weights_1], proposed[weights_2],
                                      proposed[weights_3]);
        const Eigen::Matrix4d q = (weights * kPeriod).asDiagonal();
        const double r = proposed[effort] * kPeriod;
        Eigen::Matrix4d p = q;
        Eigen::RowVector4d k = Eigen::RowVector4d::Zero();
        constexpr int kMost = 5000;
        for (int i = 0; i < kMost; ++i) {
            k = (b.transpose() * p * a) / (r + b.dot(p * b));
            const Eigen::Matrix4d following = q + a.transpose() * p * (a - b * k);
            if ((following - p).cwiseAbs().maxCoeff() < 1e-9) break;
            p = following;
        }
        gain.stage(k.transpose());
        return true;
    }

    void update() override {
        const bool is_valid = state.read() != rtcf::DataStatus::None;
        reference.read();
        if (!is_valid) {
            force.write(0.0);
            return;
        }
        const Eigen::Vector4d error =
            state.value() - Eigen::Vector4d(reference.value(), 0.0, 0.0, 0.0);
        force.write(std::clamp(-gain->dot(error), -largest.value(), largest.value()));
    }
};
RTCF_COMPONENT(Lqr, "Keeps a pendulum upright and its cart in its place")

}  // namespace
