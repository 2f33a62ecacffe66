#include "linear/steady_filter.hpp"

#include <Eigen/Cholesky>

#include "linear/matrix_text.hpp"
#include "linear/riccati.hpp"

namespace rtcf_control {

std::string steadyFilterError(const Eigen::MatrixXd& a, const Eigen::MatrixXd& c,
                              const Eigen::MatrixXd& process_noise) {
    if (const auto mode = unstabilizableMode(a.transpose(), c.transpose()))
        return "A, C: the measurements do not show the mode at z = " + complexText(*mode);
    if (const auto mode = unstabilizableMode(a, process_noise))
        return "A, process_noise: no noise moves the mode at z = " + complexText(*mode);
    return {};
}

std::optional<SteadyFilter> steadyFilter(const Eigen::MatrixXd& a, const Eigen::MatrixXd& c,
                                         const Eigen::MatrixXd& process_noise,
                                         const Eigen::MatrixXd& measurement_noise) {
    const auto found = solveRiccati(a.transpose(), c.transpose(), process_noise, measurement_noise);
    if (!found) return std::nullopt;
    const Eigen::MatrixXd& p = found->x;
    const Eigen::MatrixXd gain =
        (c * p * c.transpose() + measurement_noise).llt().solve(c * p).transpose();
    return SteadyFilter{p, gain};
}

}  // namespace rtcf_control
