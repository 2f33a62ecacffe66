#include <algorithm>
#include <cmath>
#include <limits>

#include <rtcf/component.hpp>

namespace rtcf_control {
namespace {

enum class MotorCommand { Torque, Voltage };

constexpr double kRevolution = 6.28318530717958647692;  // 2 pi
// Steps of one cycle, which bound its duration.
constexpr double kMostSteps = 1000.0;
// Largest step, by the fastest rate of the motor: the error of a step is below 1e-5 of the motion.
constexpr double kStepByRate = 0.25;

// Motion of the motor and its load, and the current: rad, rad/s, A. Also their rates of change.
struct MotorMotion {
    double angle = 0.0;
    double speed = 0.0;
    double load_angle = 0.0;
    double load_speed = 0.0;
    double current = 0.0;

    MotorMotion plus(double step, const MotorMotion& rate) const noexcept {
        return {angle + step * rate.angle, speed + step * rate.speed,
                load_angle + step * rate.load_angle, load_speed + step * rate.load_speed,
                current + step * rate.current};
    }
    bool finite() const noexcept {
        return std::isfinite(angle + speed + load_angle + load_speed + current);
    }
};

class Motor final : public rtcf::Component {
    static constexpr double kInfinity = std::numeric_limits<double>::infinity();

    rtcf::Input<double> command{this, "command"};
    rtcf::Input<double> load_torque{this, "load_torque"};
    rtcf::Output<double> position{this, "position", "rad", rtcf::Finite()};
    rtcf::Output<double> velocity{this, "velocity", "rad/s", rtcf::Finite()};
    rtcf::Output<double> load_position{this, "load_position", "rad", rtcf::Finite()};
    rtcf::Output<double> load_velocity{this, "load_velocity", "rad/s", rtcf::Finite()};
    rtcf::Output<double> torque{this, "torque", "N m", rtcf::Finite()};

    rtcf::Parameter<MotorCommand> drive{
        this,
        "drive",
        MotorCommand::Torque,
        rtcf::Choice("torque", MotorCommand::Torque),
        rtcf::Choice("voltage", MotorCommand::Voltage),
        rtcf::Doc("quantity of command: torque in N m, voltage in V")};
    rtcf::Parameter<double> inertia{this,
                                    "inertia",
                                    1e-4,
                                    rtcf::Min(1e-12),
                                    rtcf::Max(1e9),
                                    rtcf::Unit("kg m²"),
                                    rtcf::Doc("inertia of the rotor")};
    rtcf::Parameter<double> load_inertia{this,
                                         "load_inertia",
                                         0.0,
                                         rtcf::Min(0.0),
                                         rtcf::Max(1e9),
                                         rtcf::Unit("kg m²"),
                                         rtcf::Doc("inertia of the load")};
    rtcf::Parameter<double> stiffness{this,
                                      "stiffness",
                                      0.0,
                                      rtcf::Min(0.0),
                                      rtcf::Max(1e12),
                                      rtcf::Unit("N m/rad"),
                                      rtcf::Doc("stiffness of the shaft; 0 = rigid")};
    rtcf::Parameter<double> damping{this,
                                    "damping",
                                    0.0,
                                    rtcf::Min(0.0),
                                    rtcf::Max(1e12),
                                    rtcf::Unit("N m s/rad"),
                                    rtcf::Doc("damping of the shaft")};
    rtcf::Parameter<double> viscous{this,
                                    "viscous",
                                    0.0,
                                    rtcf::Min(0.0),
                                    rtcf::Max(1e12),
                                    rtcf::Unit("N m s/rad"),
                                    rtcf::Doc("viscous friction of the rotor")};
    rtcf::Parameter<double> coulomb{this,
                                    "coulomb",
                                    0.0,
                                    rtcf::Min(0.0),
                                    rtcf::Max(1e12),
                                    rtcf::Unit("N m"),
                                    rtcf::Doc("Coulomb friction of the rotor")};
    rtcf::Parameter<double> static_friction{
        this,
        "static_friction",
        0.0,
        rtcf::Min(0.0),
        rtcf::Max(1e12),
        rtcf::Unit("N m"),
        rtcf::Doc("torque that starts the rotor; at least coulomb counts")};
    rtcf::Parameter<double> stribeck_velocity{
        this,
        "stribeck_velocity",
        1.0,
        rtcf::Min(1e-6),
        rtcf::Max(1e9),
        rtcf::Unit("rad/s"),
        rtcf::Doc("velocity at which 1/e of static_friction - coulomb is left")};
    rtcf::Parameter<double> torque_limit{
        this,           "torque_limit",    kInfinity,
        rtcf::Min(0.0), rtcf::Unit("N m"), rtcf::Doc("largest torque of the motor")};
    rtcf::Parameter<double> torque_constant{
        this,
        "torque_constant",
        0.05,
        rtcf::Min(1e-9),
        rtcf::Max(1e9),
        rtcf::Unit("N m/A"),
        rtcf::Doc("torque by current, and voltage by velocity in V s/rad")};
    rtcf::Parameter<double> resistance{this,
                                       "resistance",
                                       1.0,
                                       rtcf::Min(1e-9),
                                       rtcf::Max(1e9),
                                       rtcf::Unit("ohm"),
                                       rtcf::Doc("resistance of the winding")};
    rtcf::Parameter<double> inductance{this,
                                       "inductance",
                                       0.0,
                                       rtcf::Min(0.0),
                                       rtcf::Max(1e9),
                                       rtcf::Unit("H"),
                                       rtcf::Doc("inductance of the winding; 0 = none")};
    rtcf::Parameter<double> encoder{
        this,
        "encoder",
        0.0,
        rtcf::Min(0.0),
        rtcf::Max(1e12),
        rtcf::Unit("1/turn"),
        rtcf::Doc("counts of the encoder by turn of the rotor; 0 = exact")};
    rtcf::Parameter<double> step{this,
                                 "step",
                                 1e-4,
                                 rtcf::Min(1e-9),
                                 rtcf::Max(1.0),
                                 rtcf::Unit("s"),
                                 rtcf::Doc("longest step of the integration")};

    rtcf::State<double> angle_{this, "angle", 0.0, rtcf::Unit("rad"),
                               rtcf::Doc("exact position of the rotor")};
    rtcf::State<double> speed_{this, "speed", 0.0, rtcf::Unit("rad/s"),
                               rtcf::Doc("exact velocity of the rotor")};
    rtcf::State<double> load_angle_{this, "load_angle", 0.0, rtcf::Unit("rad"),
                                    rtcf::Doc("position of the load")};
    rtcf::State<double> load_speed_{this, "load_speed", 0.0, rtcf::Unit("rad/s"),
                                    rtcf::Doc("velocity of the load")};
    rtcf::State<double> current_{this, "current", 0.0, rtcf::Unit("A"),
                                 rtcf::Doc("current of a winding with inductance")};
    rtcf::State<double> counted_{this, "counted", 0.0, rtcf::Unit("rad"),
                                 rtcf::Doc("position at the last cycle, by the encoder")};

    bool prepare(const rtcf::Values& proposed) override {
        if (proposed[stiffness] > 0.0 && proposed[load_inertia] == 0.0)
            return fail("stiffness needs a load_inertia above 0");
        if (proposed[stiffness] == 0.0 && proposed[damping] > 0.0)
            return fail("damping needs a stiffness above 0: without one the shaft is rigid");
        const double fastest = rate(proposed);
        if (proposed[step] * fastest > kStepByRate)
            return RTCF_FAIL(this,
                             "step = {} s is too long for the fastest motion, {:.3g} 1/s: set it "
                             "to {:.2g} s or less",
                             proposed[step], fastest, kStepByRate / fastest);
        const double steps = 1e-9 * static_cast<double>(period()) / proposed[step];
        if (steps > kMostSteps)
            return RTCF_FAIL(this, "step = {} s: a cycle of {} s has at most {} steps",
                             proposed[step], 1e-9 * static_cast<double>(period()), kMostSteps);
        return true;
    }

    // Upper estimate of the fastest rate of the linear parts, 1/s. Not real-time.
    double rate(const rtcf::Values& p) const {
        const bool rigid = p[stiffness] == 0.0;
        const double rotor = p[inertia] + (rigid ? p[load_inertia] : 0.0);
        const double both = rigid ? 0.0 : 1.0 / rotor + 1.0 / p[load_inertia];
        const double drop = std::max(p[static_friction] - p[coulomb], 0.0);
        double sum = std::sqrt(p[stiffness] * both) + p[damping] * both + p[viscous] / rotor +
                     drop / (p[stribeck_velocity] * rotor);
        if (p[drive] == MotorCommand::Voltage) {
            const double coupling = p[torque_constant] * p[torque_constant] / rotor;
            sum += p[inductance] > 0.0
                       ? p[resistance] / p[inductance] + std::sqrt(coupling / p[inductance])
                       : coupling / p[resistance];
        }
        return sum;
    }

    bool start() override {
        angle_ = 0.0;
        speed_ = 0.0;
        load_angle_ = 0.0;
        load_speed_ = 0.0;
        current_ = 0.0;
        counted_ = 0.0;
        return true;
    }

    // Runs in the last cycle, too, to follow the safe command of a controller.
    void safe() noexcept override { update(); }

    void update() noexcept override {
        const double wanted = command.read() != rtcf::DataStatus::None ? command.value() : 0.0;
        const double load =
            load_torque.read() != rtcf::DataStatus::None ? load_torque.value() : 0.0;
        MotorMotion motion{angle_, speed_, load_angle_, load_speed_, current_};
        // As one inertia, also if the shaft was elastic before.
        if (stiffness == 0.0) motion.load_speed = motion.speed;
        const double span = std::min(dt(), kMostSteps * step);
        if (span < dt())
            RTCF_WARN_THROTTLE(this, 10.0, "the motor lags: {} s have more than {} steps", dt(),
                               kMostSteps);
        const int steps = std::max(1, static_cast<int>(std::ceil(span / step - 1e-6)));
        for (int i = 0; i < steps; ++i) motion = advanced(motion, span / steps, wanted, load);
        if (!std::isfinite(wanted + load) || !motion.finite()) {
            // Rejected as not finite: readers keep the last outputs. The motor stands still.
            position.write(std::numeric_limits<double>::quiet_NaN());
            return;
        }
        angle_ = motion.angle;
        speed_ = motion.speed;
        load_angle_ = motion.load_angle;
        load_speed_ = motion.load_speed;
        current_ = motion.current;
        const double count = encoder > 0.0 ? kRevolution / encoder : 0.0;
        const double measured =
            count > 0.0 ? count * std::floor(motion.angle / count) : motion.angle;
        position.write(measured);
        velocity.write(count > 0.0 ? (measured - counted_) / dt() : motion.speed);
        counted_ = measured;
        load_position.write(motion.load_angle);
        load_velocity.write(motion.load_speed);
        torque.write(torqueOf(motion, wanted));
    }

    // Torque of the motor within its limit, N m.
    double torqueOf(const MotorMotion& motion, double wanted) const noexcept {
        double free = wanted;
        if (drive == MotorCommand::Voltage)
            free = torque_constant * (inductance > 0.0
                                          ? motion.current
                                          : (wanted - torque_constant * motion.speed) / resistance);
        return std::clamp(free, -torque_limit.value(), torque_limit.value());
    }

    // Torque of an elastic shaft against the rotor, N m.
    double shaftTorque(const MotorMotion& motion) const noexcept {
        return stiffness * (motion.angle - motion.load_angle) +
               damping * (motion.speed - motion.load_speed);
    }

    // Torque on the rotor without its friction, N m.
    double applied(const MotorMotion& motion, double wanted, double load) const noexcept {
        return torqueOf(motion, wanted) - (stiffness > 0.0 ? shaftTorque(motion) : load);
    }

    // Rates of change. `direction` is that of the dry friction, 0 = the rotor sticks.
    MotorMotion rates(const MotorMotion& motion, double direction, double wanted,
                      double load) const noexcept {
        const bool rigid = stiffness == 0.0;
        MotorMotion rate;
        if (direction != 0.0) {
            const double ratio = motion.speed / stribeck_velocity;
            const double dry =
                coulomb + (std::max(static_friction.value(), coulomb.value()) - coulomb) *
                              std::exp(-ratio * ratio);
            const double friction = direction * dry + viscous * motion.speed;
            rate.angle = motion.speed;
            rate.speed = (applied(motion, wanted, load) - friction) /
                         (inertia + (rigid ? load_inertia.value() : 0.0));
        }
        if (rigid) {
            rate.load_angle = rate.angle;
            rate.load_speed = rate.speed;
        } else {
            rate.load_angle = motion.load_speed;
            rate.load_speed = (shaftTorque(motion) - load) / load_inertia;
        }
        if (drive == MotorCommand::Voltage && inductance > 0.0)
            rate.current = (wanted - resistance * motion.current - torque_constant * motion.speed) /
                           inductance;
        return rate;
    }

    // One step of the Runge-Kutta method of order 4.
    MotorMotion moved(const MotorMotion& from, double direction, double time, double wanted,
                      double load) const noexcept {
        const MotorMotion a = rates(from, direction, wanted, load);
        const MotorMotion b = rates(from.plus(time / 2.0, a), direction, wanted, load);
        const MotorMotion c = rates(from.plus(time / 2.0, b), direction, wanted, load);
        const MotorMotion d = rates(from.plus(time, c), direction, wanted, load);
        MotorMotion to =
            from.plus(time / 6.0, a).plus(time / 3.0, b).plus(time / 3.0, c).plus(time / 6.0, d);
        const double most = torque_limit / torque_constant;
        to.current = std::clamp(to.current, -most, most);
        return to;
    }

    // Direction of the dry friction: that of the motion, or of the torque that starts it; 0 = the
    // torque does not start the rotor.
    double directionOf(const MotorMotion& motion, double wanted, double load) const noexcept {
        if (motion.speed != 0.0) return std::copysign(1.0, motion.speed);
        const double torque_now = applied(motion, wanted, load);
        const bool sticks =
            std::abs(torque_now) <= std::max(static_friction.value(), coulomb.value());
        return sticks ? 0.0 : std::copysign(1.0, torque_now);
    }

    MotorMotion advanced(const MotorMotion& from, double time, double wanted,
                         double load) const noexcept {
        if (coulomb == 0.0 && static_friction == 0.0) return moved(from, 1.0, time, wanted, load);
        const double direction = directionOf(from, wanted, load);
        const MotorMotion to = moved(from, direction, time, wanted, load);
        if (direction * to.speed >= 0.0) return to;
        // The rotor has come to rest within the step, and stays, or begins to move from there.
        const double share = from.speed != 0.0 ? from.speed / (from.speed - to.speed) : 0.0;
        MotorMotion rest = moved(from, direction, share * time, wanted, load);
        rest.speed = 0.0;
        if (stiffness == 0.0) rest.load_speed = 0.0;
        const double next = directionOf(rest, wanted, load);
        MotorMotion end = moved(rest, next, (1.0 - share) * time, wanted, load);
        if (next * end.speed < 0.0) {
            end.speed = 0.0;
            if (stiffness == 0.0) end.load_speed = 0.0;
        }
        return end;
    }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(
    rtcf_control::Motor, "Motor",
    "Simulated DC motor with friction and an elastic load (Spong, Modeling and Control of Elastic "
    "Joint Robots, 1987; friction: Armstrong-Hélouvry, Dupont & Canudas de Wit, A survey of "
    "models, analysis tools and compensation methods for the control of machines with friction, "
    "1994; stiction: Karnopp, 1985)",
    Motor)
