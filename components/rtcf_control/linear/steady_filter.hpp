/// @file
/// The steady state of Kalman filters. Not real-time.
#pragma once

#include <Eigen/Core>

#include <optional>
#include <string>

namespace rtcf_control {

/// Steady state of the filter of x[k+1] = A x[k] + w, y[k] = C x[k] + v.
struct SteadyFilter {
    Eigen::MatrixXd predicted_covariance;
    Eigen::MatrixXd gain;  ///< estimate by innovation
};

/// Names a mode for which the filter has no steady state; empty if all have one.
/// @param process_noise covariance of w
std::string steadyFilterError(const Eigen::MatrixXd& a, const Eigen::MatrixXd& c,
                              const Eigen::MatrixXd& process_noise);

/// @param process_noise covariance of w
/// @param measurement_noise covariance of v
/// @return empty if the Riccati equation has no solution
std::optional<SteadyFilter> steadyFilter(const Eigen::MatrixXd& a, const Eigen::MatrixXd& c,
                                         const Eigen::MatrixXd& process_noise,
                                         const Eigen::MatrixXd& measurement_noise);

}  // namespace rtcf_control
