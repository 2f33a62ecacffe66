// As components/rtcf_examples/python/interpolator.py.
#include <algorithm>
#include <cmath>
#include <rtcf/component.hpp>
#include <rtcf/eigen_type.hpp>

namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

class Interpolator final : public rtcf::Component {
    rtcf::Input<Vector6> goal{this, "goal"};
    rtcf::Output<Vector6> position{this, "position"};
    rtcf::Output<Vector6> velocity{this, "velocity"};
    rtcf::Parameter<double> duration{this, "duration", 0.5, rtcf::Min(0.01), rtcf::Unit("s")};
    // Each column belongs to one power of time.
    rtcf::State<Matrix6> coefficients{this, "coefficients", Matrix6(Matrix6::Zero())};
    rtcf::State<double> passed{this, "passed", 0.0};
    rtcf::State<Vector6> q{this, "q", Vector6(Vector6::Zero())};
    rtcf::State<Vector6> qd{this, "qd", Vector6(Vector6::Zero())};
    rtcf::State<Vector6> qdd{this, "qdd", Vector6(Vector6::Zero())};

    void plan(const Vector6& target, double t) {
        const Vector6& x = q.value();
        const Vector6& v = qd.value();
        const Vector6& a = qdd.value();
        const Vector6 d = target - x;
        const double t2 = t * t;
        const double t3 = t2 * t;
        Matrix6& c = coefficients.value();
        c.col(0) = x;
        c.col(1) = v;
        c.col(2) = a / 2.0;
        c.col(3) = (20.0 * d - 12.0 * v * t - 3.0 * a * t2) / (2.0 * t3);
        c.col(4) = (-30.0 * d + 16.0 * v * t + 3.0 * a * t2) / (2.0 * (t2 * t2));
        c.col(5) = (12.0 * d - 6.0 * v * t - a * t2) / (2.0 * (t2 * t2 * t));
        passed = 0.0;
    }

    void update() override {
        if (goal.read() == rtcf::DataStatus::New) plan(goal.value(), duration);
        passed = std::min(passed + dt(), duration.value());
        const double t = passed;
        const double t2 = t * t;
        const double t3 = t2 * t;
        const double t4 = t2 * t2;
        Vector6 powers;
        powers << 1.0, t, t2, t3, t4, t4 * t;
        Vector6 slopes;
        slopes << 0.0, 1.0, 2.0 * t, 3.0 * t2, 4.0 * t3, 5.0 * t4;
        Vector6 curvatures;
        curvatures << 0.0, 0.0, 2.0, 6.0 * t, 12.0 * t2, 20.0 * t3;
        q.value().noalias() = coefficients.value() * powers;
        qd.value().noalias() = coefficients.value() * slopes;
        qdd.value().noalias() = coefficients.value() * curvatures;
        position.write(q);
        velocity.write(qd);
    }
};
RTCF_COMPONENT(Interpolator, "Joint positions, velocities and accelerations from points")

}  // namespace
