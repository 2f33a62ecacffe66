// As components/rtcf_examples/python/mpc.py.
#include <cmath>
#include <cstdint>
#include <rtcf/component.hpp>
#include <rtcf/eigen_type.hpp>

namespace {

constexpr int kHorizon = 10;
constexpr int kInputs = 3;
constexpr int kStates = 6;
constexpr int kSize = kHorizon * kInputs;
constexpr double kStep = 0.01;

using StateVector = Eigen::Matrix<double, kStates, 1>;
using StateMatrix = Eigen::Matrix<double, kStates, kStates>;
using InputMatrix = Eigen::Matrix<double, kStates, kInputs>;
using Plan = Eigen::Matrix<double, kSize, 1>;

class Mpc final : public rtcf::Component {
    struct Problem {
        Eigen::Matrix<double, kSize, kSize> hessian;
        Eigen::Matrix<double, kSize, kStates> linear;
        double step = 0.0;
    };

    rtcf::Input<StateVector> state{this, "state"};
    rtcf::Input<StateVector> setpoint{this, "setpoint"};
    rtcf::Output<Eigen::Vector3d> command{this, "command", "", rtcf::Finite()};
    rtcf::Parameter<double> position_weight{this, "position_weight", 100.0, rtcf::Min(0.0)};
    rtcf::Parameter<double> velocity_weight{this, "velocity_weight", 1.0, rtcf::Min(0.0)};
    rtcf::Parameter<double> effort{this, "effort", 0.01, rtcf::Min(1e-6)};
    rtcf::Parameter<double> limit{this, "limit", 5.0, rtcf::Min(0.0), rtcf::Unit("m/s^2")};
    rtcf::Parameter<std::int64_t> iterations{this, "iterations", 20, rtcf::Min(1.0),
                                             rtcf::Max(100.0)};
    rtcf::Derived<Problem> problem{this};
    rtcf::State<Plan> plan{this, "plan", Plan(Plan::Zero())};

    bool prepare(const rtcf::Values& proposed) override {
        constexpr int kRows = kHorizon * kStates;
        StateMatrix a = StateMatrix::Identity();
        a.topRightCorner<3, 3>() = Eigen::Matrix3d::Identity() * kStep;
        InputMatrix b;
        b << Eigen::Matrix3d::Identity() * (kStep * kStep) / 2.0,
            Eigen::Matrix3d::Identity() * kStep;
        StateVector weights;
        weights << Eigen::Vector3d::Constant(proposed[position_weight]),
            Eigen::Vector3d::Constant(proposed[velocity_weight]);
        Eigen::MatrixXd forced = Eigen::MatrixXd::Zero(kRows, kSize);
        Eigen::MatrixXd free = Eigen::MatrixXd::Zero(kRows, kStates);
        StateMatrix power = StateMatrix::Identity();
        for (int i = 0; i < kHorizon; ++i) {
            // The effect of an input i steps later.
            const InputMatrix block = power * b;
            for (int k = i; k < kHorizon; ++k)
                forced.block<kStates, kInputs>(k * kStates, (k - i) * kInputs) = block;
            power = (a * power).eval();
            free.middleRows<kStates>(i * kStates) = power;
        }
        Eigen::MatrixXd weighted = forced.transpose();
        for (int i = 0; i < kHorizon; ++i)
            weighted.middleCols<kStates>(i * kStates) *= weights.asDiagonal();
        Problem next;
        next.hessian = weighted * forced;
        next.hessian.diagonal().array() += proposed[effort];
        next.linear = weighted * free;
        next.step = 1.0 / next.hessian.cwiseAbs().rowwise().sum().maxCoeff();
        problem.stage(next);
        return true;
    }

    void update() override {
        state.read();
        setpoint.read();
        const Problem& qp = *problem;
        const Plan gradient = qp.linear * (state.value() - setpoint.value());
        Plan u;
        u << plan.value().tail<kSize - kInputs>(), plan.value().tail<kInputs>();
        Plan previous = u;
        double momentum = 1.0;
        for (std::int64_t i = 0; i < iterations; ++i) {
            const double following = (1.0 + std::sqrt(1.0 + 4.0 * momentum * momentum)) / 2.0;
            const Plan v = u + (momentum - 1.0) / following * (u - previous);
            previous = u;
            u = (v - qp.step * (qp.hessian * v + gradient))
                    .cwiseMax(-limit.value())
                    .cwiseMin(limit.value());
            momentum = following;
        }
        plan = u;
        command.write(u.head<kInputs>());
    }
};
RTCF_COMPONENT(Mpc, "Accelerates a mass in three axes to its set point")

}  // namespace
