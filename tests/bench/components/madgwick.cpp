// As components/rtcf_examples/python/madgwick.py.
#include <rtcf/component.hpp>
#include <rtcf/eigen_type.hpp>

namespace {

// Product of two quaternions, w first.
Eigen::Vector4d product(const Eigen::Vector4d& p, const Eigen::Vector4d& q) {
    const Eigen::Vector3d a = p.tail<3>();
    const Eigen::Vector3d b = q.tail<3>();
    Eigen::Vector4d result;
    result[0] = p[0] * q[0] - a.dot(b);
    result.tail<3>() = p[0] * b + q[0] * a + a.cross(b);
    return result;
}

class Madgwick final : public rtcf::Component {
    rtcf::Input<Eigen::Vector3d> gyro{this, "gyro"};
    rtcf::Input<Eigen::Vector3d> acceleration{this, "acceleration"};
    rtcf::Output<Eigen::Vector4d> orientation{this, "orientation"};
    rtcf::Parameter<double> beta{this, "beta", 0.1, rtcf::Min(0.0), rtcf::Max(5.0)};
    rtcf::State<Eigen::Vector4d> q{this, "q", Eigen::Vector4d(1.0, 0.0, 0.0, 0.0)};

    void update() override {
        gyro.read();
        const bool is_valid = acceleration.read() != rtcf::DataStatus::None;
        const Eigen::Vector3d& turn = gyro.value();
        Eigen::Vector4d rate = 0.5 * product(q, Eigen::Vector4d(0.0, turn.x(), turn.y(), turn.z()));
        const double length = acceleration.value().norm();
        if (is_valid && length > 1e-6) {
            const Eigen::Vector3d a = acceleration.value() / length;
            const double w = q.value()[0];
            const double x = q.value()[1];
            const double y = q.value()[2];
            const double z = q.value()[3];
            const Eigen::Vector3d f(2.0 * (x * z - w * y) - a.x(), 2.0 * (w * x + y * z) - a.y(),
                                    2.0 * (0.5 - x * x - y * y) - a.z());
            Eigen::Matrix<double, 3, 4> jacobian;
            jacobian << -2.0 * y, 2.0 * z, -2.0 * w, 2.0 * x,  //
                2.0 * x, 2.0 * w, 2.0 * z, 2.0 * y,            //
                0.0, -4.0 * x, -4.0 * y, 0.0;
            const Eigen::Vector4d step = jacobian.transpose() * f;
            const double size = step.norm();
            if (size > 0.0) rate -= beta * step / size;
        }
        q += rate * dt();
        q /= q.value().norm();
        orientation.write(q);
    }
};
RTCF_COMPONENT(Madgwick, "Estimates the orientation of an inertial measurement unit")

}  // namespace
