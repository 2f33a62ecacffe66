// An extended Kalman filter: the example of docs/control/kalman_filter.md.
#include <cmath>

#include <rtcf/component.hpp>
#include <rtcf/kalman.hpp>

namespace {

class PendulumFilter final : public rtcf::ExtendedKalmanFilter<2, 1, 1> {
   public:
    PendulumFilter()
        : ExtendedKalmanFilter({{{"angle", "rad"}, {"rate", "rad/s"}}}, {{{"torque", "N m"}}},
                               {{{"acceleration", "m/s^2"}}}) {}

   private:
    static constexpr double kGravity = 9.81;  // m/s^2; a mass of 1 kg at a rod of 1 m

    void predict(State& x, const Input& u, double dt, StateMatrix& jacobian) const override {
        jacobian << 1.0, dt, -kGravity * std::cos(x[0]) * dt, 1.0;
        x = State(x[0] + x[1] * dt, x[1] + (u[0] - kGravity * std::sin(x[0])) * dt);
    }
    void measure(const State& x, Measurement& y, MeasurementMatrix& jacobian) const override {
        y[0] = kGravity * std::sin(x[0]);
        jacobian << kGravity * std::cos(x[0]), 0.0;
    }
};

}  // namespace

RTCF_COMPONENT(PendulumFilter, "Estimates the angle of a pendulum")
