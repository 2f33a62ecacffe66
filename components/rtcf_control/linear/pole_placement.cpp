#include "linear/pole_placement.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Jacobi>
#include <Eigen/QR>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "linear/riccati.hpp"

namespace rtcf_control {
namespace {

using Complex = std::complex<double>;

// The gain of a controllable pair with one input.
Eigen::RowVectorXd placeOne(const Eigen::MatrixXd& a, const Eigen::VectorXd& b,
                            const std::vector<Complex>& poles) {
    const Eigen::Index n = a.rows();
    // Coordinates in which the input moves the first state only, and each state the next one.
    const Eigen::MatrixXd first = b.householderQr().householderQ();
    const Eigen::HessenbergDecomposition<Eigen::MatrixXd> form(first.transpose() * a * first);
    // Its Householder vectors leave the first state as it is.
    Eigen::MatrixXcd turn = (first * Eigen::MatrixXd(form.matrixQ())).cast<Complex>();
    Eigen::MatrixXcd h = Eigen::MatrixXd(form.matrixH()).cast<Complex>();
    Eigen::VectorXcd input = turn.adjoint() * b.cast<Complex>();
    Eigen::RowVectorXcd gain = Eigen::RowVectorXcd::Zero(n);
    for (Eigen::Index at = 0; at < n; ++at) {
        const Complex pole = poles[static_cast<std::size_t>(at)];
        // Eigenvector of the part from `at` on: the input does not act on its rows after the first.
        Eigen::VectorXcd x = Eigen::VectorXcd::Zero(n);
        x[n - 1] = 1.0;
        for (Eigen::Index row = n - 1; row > at; --row) {
            Complex sum = -pole * x[row];
            for (Eigen::Index column = row; column < n; ++column) sum += h(row, column) * x[column];
            x[row - 1] = -sum / h(row, row - 1);
            x /= x.norm();
        }
        // Rotations from the last row up make it the first unit vector.
        for (Eigen::Index row = n - 1; row > at; --row) {
            Eigen::JacobiRotation<Complex> rotation;
            Complex length;
            rotation.makeGivens(x[row - 1], x[row], &length);
            x.applyOnTheLeft(row - 1, row, rotation.adjoint());
            h.applyOnTheLeft(row - 1, row, rotation.adjoint());
            h.applyOnTheRight(row - 1, row, rotation);
            input.applyOnTheLeft(row - 1, row, rotation.adjoint());
            turn.applyOnTheRight(row - 1, row, rotation);
        }
        gain[at] = (h(at, at) - pole) / input[at];
    }
    return (gain * turn.adjoint()).real();
}

}  // namespace

std::optional<Eigen::MatrixXd> placePoles(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b,
                                          const std::vector<Complex>& poles) {
    std::vector<Complex> ordered = poles;  // conjugates side by side
    std::sort(ordered.begin(), ordered.end(), [](const Complex& p, const Complex& q) {
        const auto key = [](const Complex& z) {
            return std::tuple(z.real(), std::abs(z.imag()), z.imag());
        };
        return key(p) < key(q);
    });
    for (Eigen::Index tried = 0; tried <= b.cols(); ++tried) {
        Eigen::VectorXd weights = Eigen::VectorXd::Zero(b.cols());
        if (tried == 0) {
            for (Eigen::Index i = 0; i < b.cols(); ++i)
                weights[i] = 1.0 / (b.col(i).norm() * std::sqrt(1.0 + static_cast<double>(i)));
        } else {
            weights[tried - 1] = 1.0;
        }
        const Eigen::VectorXd together = b * weights;
        if (!together.allFinite() || uncontrollablePart(a, together).rows() != 0) continue;
        const Eigen::MatrixXd gain = weights * placeOne(a, together, ordered);
        if (gain.allFinite()) return gain;
    }
    return std::nullopt;
}

}  // namespace rtcf_control
