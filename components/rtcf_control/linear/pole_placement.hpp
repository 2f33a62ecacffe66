/// @file
/// Gains for wanted poles. Not real-time.
#pragma once

#include <Eigen/Core>

#include <complex>
#include <optional>
#include <vector>

namespace rtcf_control {

/// Gain K for which A - B K has the wanted eigenvalues, by the eigenvectors of the closed loop in
/// Hessenberg form (Petkov, Christov & Konstantinov, A computational algorithm for pole assignment
/// of linear single-input systems, 1984). Several inputs act together, by fixed weights.
/// @param poles one for each state; complex ones in pairs of conjugates
/// @return empty if the pair is not controllable by the inputs together
std::optional<Eigen::MatrixXd> placePoles(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b,
                                          const std::vector<std::complex<double>>& poles);

}  // namespace rtcf_control
