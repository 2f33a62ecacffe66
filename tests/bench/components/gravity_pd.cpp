// As components/rtcf_examples/python/gravity_pd.py.
#include <rtcf/component.hpp>
#include <rtcf/eigen_type.hpp>

namespace {

constexpr int kJoints = 3;
constexpr double kGravity = 9.81;

struct Link {
    double mass;
    double length;
    double centre;
};

constexpr Link kLinks[kJoints] = {{3.0, 0.4, 0.2}, {2.0, 0.35, 0.17}, {1.0, 0.2, 0.08}};

class GravityPd final : public rtcf::Component {
    rtcf::Input<Eigen::Vector3d> setpoint{this, "setpoint"};
    rtcf::Input<Eigen::Vector3d> position{this, "position"};
    rtcf::Input<Eigen::Vector3d> velocity{this, "velocity"};
    rtcf::Output<Eigen::Vector3d> torque{this, "torque", "N m", rtcf::Finite()};
    rtcf::Parameter<double> kp_0{this, "kp_0", 80.0};
    rtcf::Parameter<double> kp_1{this, "kp_1", 50.0};
    rtcf::Parameter<double> kp_2{this, "kp_2", 20.0};
    rtcf::Parameter<double> kd_0{this, "kd_0", 8.0};
    rtcf::Parameter<double> kd_1{this, "kd_1", 5.0};
    rtcf::Parameter<double> kd_2{this, "kd_2", 1.0};
    rtcf::Parameter<double> limit_0{this, "limit_0", 60.0};
    rtcf::Parameter<double> limit_1{this, "limit_1", 40.0};
    rtcf::Parameter<double> limit_2{this, "limit_2", 15.0};
    rtcf::State<Eigen::Vector3d> last{this, "last", Eigen::Vector3d(Eigen::Vector3d::Zero())};

    static Eigen::Vector3d gravity(const Eigen::Vector3d& q) {
        Eigen::Vector3d along;
        double angle = 0.0;
        for (int i = 0; i < kJoints; ++i) {
            angle += q[i];
            along[i] = std::cos(angle);
        }
        Eigen::Vector3d result = Eigen::Vector3d::Zero();
        for (int i = 0; i < kJoints; ++i) {
            double before = 0.0;  // of links i to k
            for (int k = i; k < kJoints; ++k) {
                result[i] += kLinks[k].mass * kGravity * (kLinks[k].centre * along[k] + before);
                before += kLinks[k].length * along[k];
            }
        }
        return result;
    }

    void update() override {
        const bool is_led = setpoint.read() != rtcf::DataStatus::None;
        position.read();
        velocity.read();
        const Eigen::Vector3d& q = position.value();
        Eigen::Vector3d wanted = gravity(q);
        if (is_led) {
            const Eigen::Vector3d kp(kp_0, kp_1, kp_2);
            const Eigen::Vector3d kd(kd_0, kd_1, kd_2);
            wanted += kp.cwiseProduct(setpoint.value() - q) - kd.cwiseProduct(velocity.value());
        }
        const Eigen::Vector3d limit(limit_0, limit_1, limit_2);
        last = wanted.cwiseMax(-limit).cwiseMin(limit);
        torque.write(last);
    }

    void safe() noexcept override {
        position.read();
        velocity.read();
        const Eigen::Vector3d kd(kd_0, kd_1, kd_2);
        torque.write(gravity(position.value()) - kd.cwiseProduct(velocity.value()));
    }
};
RTCF_COMPONENT(GravityPd, "Holds an arm at its set point against gravity")

}  // namespace
