// The same as tests/components/python/filters.py, as one writes it in C++ with Eigen.
#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <rtcf/component.hpp>
#include <rtcf/eigen_type.hpp>

namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

class Pid final : public rtcf::Component {
    rtcf::Input<double> setpoint{this, "setpoint"};
    rtcf::Input<double> measured{this, "measured"};
    rtcf::Output<double> effort{this, "effort", "N m"};
    rtcf::Parameter<double> kp{this, "kp", 2.0, rtcf::Min(0.0), rtcf::Max(10.0)};
    rtcf::Parameter<double> ki{this, "ki", 1.0, rtcf::Min(0.0), rtcf::Max(10.0)};
    rtcf::Parameter<double> kd{this, "kd", 0.01, rtcf::Min(0.0), rtcf::Max(1.0)};
    rtcf::Parameter<double> limit{this, "limit", 10.0, rtcf::Min(0.1), rtcf::Max(100.0)};
    rtcf::State<double> integral{this, "integral", 0.0};
    rtcf::State<double> filtered{this, "filtered", 0.0};
    rtcf::State<double> last{this, "last", 0.0};

    void update() override {
        setpoint.read();
        measured.read();
        const double error = setpoint.value() - measured.value();
        const double bound = limit;
        integral = std::clamp(integral + ki * error * dt(), -bound, bound);
        const double rate = (error - last) / dt();
        filtered += 0.1 * (rate - filtered);
        last = error;
        effort.write(std::clamp(kp * error + integral + kd * filtered, -bound, bound));
    }
};
RTCF_COMPONENT(Pid, "PID controller with limited effort and a filtered derivative")

class Kalman final : public rtcf::Component {
    rtcf::Input<Eigen::Vector3d> position{this, "position"};
    rtcf::Output<Vector6> estimate{this, "estimate"};
    rtcf::State<Vector6> x{this, "x", Vector6(Vector6::Zero())};
    rtcf::State<Matrix6> p{this, "p", Matrix6(Matrix6::Identity())};
    Matrix6 f = Matrix6::Identity();
    Eigen::Matrix<double, 3, 6> h = Eigen::Matrix<double, 3, 6>::Zero();
    Matrix6 q = 1e-4 * Matrix6::Identity();
    Eigen::Matrix3d r = 1e-2 * Eigen::Matrix3d::Identity();

    bool configure() override {
        f.topRightCorner<3, 3>() = 1e-3 * Eigen::Matrix3d::Identity();
        h.leftCols<3>().setIdentity();
        return true;
    }
    void update() override {
        const bool is_new = position.read() == rtcf::DataStatus::New;
        Vector6 state = f * x.value();
        Matrix6 covariance = f * p.value() * f.transpose() + q;
        if (is_new) {
            const Eigen::Matrix3d innovation = covariance.topLeftCorner<3, 3>() + r;
            const Eigen::Matrix<double, 6, 3> gain =
                covariance.leftCols<3>() * innovation.inverse();
            state += gain * (position.value() - state.head<3>());
            covariance = ((Matrix6::Identity() - gain * h) * covariance).eval();
        }
        x = state;
        p = covariance;
        estimate.write(state);
    }
};
RTCF_COMPONENT(Kalman, "Kalman filter of a position in space: six states, three measured")

class Solver final : public rtcf::Component {
    rtcf::Input<Eigen::Matrix4d> a{this, "a"};
    rtcf::Input<Eigen::Vector4d> b{this, "b"};
    rtcf::Output<Eigen::Vector4d> x{this, "x"};
    rtcf::Output<Eigen::Matrix4d> lower{this, "lower"};
    rtcf::State<Eigen::Vector4d> spectrum{this, "spectrum",
                                          Eigen::Vector4d(Eigen::Vector4d::Zero())};

    void update() override {
        a.read();
        b.read();
        const Eigen::Matrix4d matrix = a.value().cwiseMax(-1e6).cwiseMin(1e6);
        if (!matrix.allFinite()) return;
        const Eigen::Matrix4d regular = matrix * matrix.transpose() + Eigen::Matrix4d::Identity();
        x.write(regular.partialPivLu().solve(b.value()));
        lower.write(Eigen::Matrix4d(regular.llt().matrixL()));
        Eigen::Vector4d next = spectrum.value();
        for (int i = 1; i < 4; ++i) next[i] = b.value()[i] > 0.0 ? std::sin(b.value()[i]) : 0.0;
        spectrum = next;
    }
};
RTCF_COMPONENT(Solver, "Linear systems of four, solved and decomposed")

}  // namespace
