/// @file
/// Discrete algebraic Riccati equations, and the pairs of matrices for which they have a solution.
/// Not real-time.
#pragma once

#include <Eigen/Core>

#include <complex>
#include <optional>

namespace rtcf_control {

/// Solution X of X = A'XA - (A'XB + N)(R + B'XB)^-1 (A'XB + N)' + Q for which A - B K is stable,
/// and the gain K = (R + B'XB)^-1 (A'XB + N)'.
struct RiccatiSolution {
    Eigen::MatrixXd x;
    Eigen::MatrixXd k;
};

/// Structure-preserving doubling (Chu, Fan, Lin & Wang, Structure-preserving algorithms for
/// periodic discrete-time algebraic Riccati equations, International Journal of Control, 2004).
/// @param n null = 0
/// @return empty if R is not positive definite, or if there is no such solution
std::optional<RiccatiSolution> solveRiccati(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b,
                                            const Eigen::MatrixXd& q, const Eigen::MatrixXd& r,
                                            const Eigen::MatrixXd* n = nullptr);

/// The part of x[k+1] = A x[k] + B u[k] that the input does not reach (staircase form: Van Dooren,
/// The generalized eigenstructure problem in linear system theory, 1981). Without rows if the pair
/// is controllable.
Eigen::MatrixXd uncontrollablePart(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

/// An eigenvalue on or outside the unit circle in the part that the input does not reach: the pair
/// cannot be stabilised. With A' and C', one that the output does not show.
std::optional<std::complex<double>> unstabilizableMode(const Eigen::MatrixXd& a,
                                                       const Eigen::MatrixXd& b);

/// The largest absolute value of an eigenvalue; below 1 = stable.
double spectralRadius(const Eigen::MatrixXd& a);

}  // namespace rtcf_control
