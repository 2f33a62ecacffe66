// As components/rtcf_examples/python/kalman.py.
#include <cmath>
#include <rtcf/component.hpp>
#include <rtcf/eigen_type.hpp>

namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

double wrap(double angle) { return std::atan2(std::sin(angle), std::cos(angle)); }

Matrix6 diagonal(double a, double b, double c, double d, double e, double f) {
    Vector6 values;
    values << a, b, c, d, e, f;
    return values.asDiagonal();
}

class Kalman final : public rtcf::Component {
    rtcf::Input<Eigen::Vector2d> gps{this, "gps"};
    rtcf::Input<double> odometry{this, "odometry"};
    rtcf::Input<double> gyro{this, "gyro"};
    rtcf::Output<Vector6> estimate{this, "estimate"};
    rtcf::Output<Vector6> deviation{this, "deviation"};
    rtcf::Parameter<double> gps_noise{this, "gps_noise", 0.5, rtcf::Min(1e-3), rtcf::Unit("m")};
    rtcf::Parameter<double> odometry_noise{this, "odometry_noise", 0.05, rtcf::Min(1e-3),
                                           rtcf::Unit("m/s")};
    rtcf::Parameter<double> gyro_noise{this, "gyro_noise", 0.01, rtcf::Min(1e-4),
                                       rtcf::Unit("rad/s")};
    rtcf::State<Vector6> x{this, "x", Vector6(Vector6::Zero())};
    rtcf::State<Matrix6> p{this, "p", Matrix6(Matrix6::Zero())};
    Matrix6 noise = diagonal(1e-4, 1e-4, 1e-4, 1e-2, 1e-2, 1e-6);

    bool start() override {
        x = Vector6(Vector6::Zero());
        p = diagonal(1.0, 1.0, 0.1, 0.1, 0.01, 0.001);
        return true;
    }

    void predict() {
        Vector6& state = x.value();
        const double heading = state[2];
        const double speed = state[3];
        const double rate = state[4];
        const double c = std::cos(heading);
        const double s = std::sin(heading);
        const double step = dt();
        Matrix6 f = Matrix6::Identity();
        f(0, 2) = -speed * s * step;
        f(0, 3) = c * step;
        f(1, 2) = speed * c * step;
        f(1, 3) = s * step;
        f(2, 4) = step;
        Vector6 slope;
        slope << speed * c, speed * s, rate, 0.0, 0.0, 0.0;
        state += slope * step;
        state[2] = wrap(state[2]);
        p = (f * p.value() * f.transpose() + noise * step).eval();
    }

    void correct(const Vector6& h, double residual, double variance) {
        Vector6& state = x.value();
        const Vector6 ph = p.value() * h;
        const Vector6 gain = ph / (h.dot(ph) + variance);
        state += gain * residual;
        state[2] = wrap(state[2]);
        const Matrix6 a = Matrix6::Identity() - gain * h.transpose();
        p = (a * p.value() * a.transpose() + variance * (gain * gain.transpose())).eval();
    }

    void update() override {
        predict();
        const Vector6& state = x.value();
        if (odometry.read() == rtcf::DataStatus::New) {
            Vector6 h;
            h << 0.0, 0.0, 0.0, 1.0, 0.0, 0.0;
            correct(h, odometry.value() - state[3], odometry_noise * odometry_noise);
        }
        if (gyro.read() == rtcf::DataStatus::New) {
            Vector6 h;
            h << 0.0, 0.0, 0.0, 0.0, 1.0, 1.0;
            correct(h, gyro.value() - state[4] - state[5], gyro_noise * gyro_noise);
        }
        if (gps.read() == rtcf::DataStatus::New) {
            for (int axis = 0; axis < 2; ++axis) {
                Vector6 h = Vector6::Zero();
                h[axis] = 1.0;
                correct(h, gps.value()[axis] - state[axis], gps_noise * gps_noise);
            }
        }
        estimate.write(state);
        deviation.write(p.value().diagonal().cwiseSqrt());
    }
};
RTCF_COMPONENT(Kalman, "Estimates x, y, heading, speed, turn rate and gyroscope bias")

}  // namespace
