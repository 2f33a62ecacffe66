#include "linear/riccati.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>

#include <algorithm>
#include <cmath>

namespace rtcf_control {
namespace {

// Modes this close to the unit circle count as unstable.
constexpr double kMargin = 1e-9;
// Relative size below which an input counts as none.
constexpr double kNoInput = 1e-10;
// Doublings: the error is that of 2^kMostDoublings steps of the recursion.
constexpr int kMostDoublings = 60;
constexpr double kConverged = 1e-15;

Eigen::MatrixXd symmetric(const Eigen::MatrixXd& matrix) {
    return 0.5 * (matrix + matrix.transpose());
}

}  // namespace

std::optional<RiccatiSolution> solveRiccati(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b,
                                            const Eigen::MatrixXd& q, const Eigen::MatrixXd& r,
                                            const Eigen::MatrixXd* n) {
    const Eigen::LLT<Eigen::MatrixXd> cost(r);
    if (cost.info() != Eigen::Success) return std::nullopt;
    const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(a.rows(), a.cols());
    const Eigen::MatrixXd cross = n != nullptr ? *n : Eigen::MatrixXd::Zero(a.rows(), b.cols());
    // Without the cross term, by the input u + R^-1 N' x.
    Eigen::MatrixXd forward = a - b * cost.solve(cross.transpose());
    Eigen::MatrixXd g = symmetric(b * cost.solve(b.transpose()));
    Eigen::MatrixXd h = symmetric(q - cross * cost.solve(cross.transpose()));
    for (int i = 0; i < kMostDoublings; ++i) {
        const Eigen::PartialPivLU<Eigen::MatrixXd> w(one + g * h);
        const Eigen::MatrixXd moved = w.solve(forward);
        const Eigen::MatrixXd added = symmetric(forward.transpose() * h * moved);
        g = symmetric(g + forward * w.solve(g) * forward.transpose());
        h += added;
        forward = (forward * moved).eval();
        if (!h.allFinite() || !g.allFinite()) return std::nullopt;
        if (added.norm() <= kConverged * h.norm()) break;
    }
    RiccatiSolution solution;
    solution.x = symmetric(h);
    solution.k =
        (r + b.transpose() * h * b).llt().solve((a.transpose() * h * b + cross).transpose());
    if (!solution.k.allFinite() || spectralRadius(a - b * solution.k) >= 1.0) return std::nullopt;
    return solution;
}

Eigen::MatrixXd uncontrollablePart(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
    Eigen::MatrixXd rest = a;
    Eigen::MatrixXd input = b;
    double scale = b.size() == 0 ? 0.0 : b.norm();
    while (rest.rows() > 0) {
        if (input.cols() == 0 || scale == 0.0) return rest;
        const Eigen::JacobiSVD<Eigen::MatrixXd> svd(input, Eigen::ComputeFullU);
        const Eigen::Index rank = (svd.singularValues().array() > kNoInput * scale).count();
        if (rank == 0) return rest;
        const Eigen::MatrixXd turned = svd.matrixU().transpose() * rest * svd.matrixU();
        const Eigen::Index left = rest.rows() - rank;
        input = turned.bottomLeftCorner(left, rank);
        rest = turned.bottomRightCorner(left, left).eval();
        scale = a.norm();
    }
    return rest;
}

std::optional<std::complex<double>> unstabilizableMode(const Eigen::MatrixXd& a,
                                                       const Eigen::MatrixXd& b) {
    const Eigen::MatrixXd part = uncontrollablePart(a, b);
    if (part.rows() == 0) return std::nullopt;
    const Eigen::VectorXcd modes = part.eigenvalues();
    Eigen::Index largest = 0;
    if (modes.cwiseAbs().maxCoeff(&largest) < 1.0 - kMargin) return std::nullopt;
    return modes[largest];
}

double spectralRadius(const Eigen::MatrixXd& a) {
    return a.rows() == 0 ? 0.0 : a.eigenvalues().cwiseAbs().maxCoeff();
}

}  // namespace rtcf_control
