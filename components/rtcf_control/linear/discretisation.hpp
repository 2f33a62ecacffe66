/// @file
/// Discretisation of linear systems dx/dt = A x + B u for a period. Not real-time.
#pragma once

#include <Eigen/Core>

#include <optional>

namespace rtcf_control {

/// x[k+1] = a x[k] + b u[k].
struct DiscreteSystem {
    Eigen::MatrixXd a;
    Eigen::MatrixXd b;
};

/// Exact for an input that is constant within a period: the exponential of [A B; 0 0] times the
/// period (Franklin, Powell & Workman, Digital Control of Dynamic Systems, 3rd edition, 1998,
/// section 4.3).
DiscreteSystem zeroOrderHold(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, double period_s);

/// Bilinear transform (Tustin's method): the trapezoidal rule. `b` is the sum of the factors of
/// u[k] and u[k+1], which are equal.
/// @return empty if A has an eigenvalue of 2 / period
std::optional<DiscreteSystem> tustin(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b,
                                     double period_s);

/// Integral of exp(A s) Q exp(A' s) over a period: the covariance that white noise of the intensity
/// Q adds (Van Loan, Computing integrals involving the matrix exponential, 1978).
Eigen::MatrixXd sampledNoise(const Eigen::MatrixXd& a, const Eigen::MatrixXd& q, double period_s);

/// Cost x' q x + 2 x' n u + u' r u of one period.
struct SampledCost {
    Eigen::MatrixXd q;
    Eigen::MatrixXd n;
    Eigen::MatrixXd r;
};

/// Integral of x' Q x + u' R u over a period with a constant input.
SampledCost sampledCost(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b,
                        const Eigen::MatrixXd& q, const Eigen::MatrixXd& r, double period_s);

}  // namespace rtcf_control
