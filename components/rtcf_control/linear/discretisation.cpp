#include "linear/discretisation.hpp"

#include <Eigen/LU>
#include <unsupported/Eigen/MatrixFunctions>

#include <algorithm>
#include <cmath>

namespace rtcf_control {
namespace {

// Below this reciprocal condition number a matrix counts as singular.
constexpr double kSingular = 1e-13;

// [A B; 0 0].
Eigen::MatrixXd withInput(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
    const Eigen::Index n = a.rows();
    const Eigen::Index m = b.cols();
    Eigen::MatrixXd both = Eigen::MatrixXd::Zero(n + m, n + m);
    both.topLeftCorner(n, n) = a;
    both.topRightCorner(n, m) = b;
    return both;
}

}  // namespace

DiscreteSystem zeroOrderHold(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, double period_s) {
    const Eigen::Index n = a.rows();
    const Eigen::MatrixXd moved = (period_s * withInput(a, b)).exp();
    return {moved.topLeftCorner(n, n), moved.topRightCorner(n, b.cols())};
}

std::optional<DiscreteSystem> tustin(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b,
                                     double period_s) {
    const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(a.rows(), a.cols());
    const Eigen::MatrixXd half = 0.5 * period_s * a;
    const Eigen::PartialPivLU<Eigen::MatrixXd> left(one - half);
    if (!(left.rcond() > kSingular)) return std::nullopt;
    return DiscreteSystem{left.solve(one + half), left.solve(period_s * b)};
}

Eigen::MatrixXd sampledNoise(const Eigen::MatrixXd& a, const Eigen::MatrixXd& q, double period_s) {
    // Over a part of the period in which exp(-A s) is not large, then doubled.
    const Eigen::Index n = a.rows();
    const double size = a.cwiseAbs().colwise().sum().maxCoeff() * period_s;
    const int doublings = size > 1.0 ? static_cast<int>(std::ceil(std::log2(size))) : 0;
    const double part_s = std::ldexp(period_s, -doublings);
    Eigen::MatrixXd both = Eigen::MatrixXd::Zero(2 * n, 2 * n);
    both.topLeftCorner(n, n) = -a;
    both.topRightCorner(n, n) = q;
    both.bottomRightCorner(n, n) = a.transpose();
    both = (part_s * both).exp();
    Eigen::MatrixXd moved = both.bottomRightCorner(n, n).transpose();
    Eigen::MatrixXd noise = moved * both.topRightCorner(n, n);
    for (int i = 0; i < doublings; ++i) {
        noise += (moved * noise * moved.transpose()).eval();
        moved = (moved * moved).eval();
    }
    return 0.5 * (noise + noise.transpose());
}

SampledCost sampledCost(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b,
                        const Eigen::MatrixXd& q, const Eigen::MatrixXd& r, double period_s) {
    const Eigen::Index n = a.rows();
    const Eigen::Index m = b.cols();
    Eigen::MatrixXd weight = Eigen::MatrixXd::Zero(n + m, n + m);
    weight.topLeftCorner(n, n) = q;
    weight.bottomRightCorner(m, m) = r;
    const Eigen::MatrixXd cost = sampledNoise(withInput(a, b).transpose(), weight, period_s);
    return {cost.topLeftCorner(n, n), cost.topRightCorner(n, m), cost.bottomRightCorner(m, m)};
}

}  // namespace rtcf_control
