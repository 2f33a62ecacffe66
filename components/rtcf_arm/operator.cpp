#include <sensor_msgs/JointState.h>
#include <sensor_msgs/Joy.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>

#include <rtcf/component.hpp>

namespace rtcf_arm {
namespace {

constexpr std::size_t kJoints = 6;
using Positions = std::array<double, kJoints>;

// The poses of the tour, rad; from one that is upright to others around the table.
constexpr std::array<Positions, 6> kTour{{
    {0.0, 0.3, 1.6, 0.0, 1.24, 0.0},
    {0.5, 0.6, 1.4, 0.0, 1.14, 0.5},
    {0.5, 0.3, 1.0, 0.6, 1.4, -0.8},
    {-0.6, -0.4, 1.5, -0.9, 0.9, 1.2},
    {-0.6, 0.6, 1.4, 0.0, 1.14, -0.6},
    {0.0, -0.8, 2.1, 0.0, 0.6, 0.0},
}};

// Panel of an operator: source of the targets, targets, emergency stop and its reset.
class Operator final : public rtcf::Component {
    enum class Mode { Stand, Tour, Sliders, Joystick, Goal };

    rtcf::Input<sensor_msgs::Joy> joy{this, "joy"};
    rtcf::Input<sensor_msgs::JointState> goal{this, "goal"};
    rtcf::Input<sensor_msgs::JointState> command{this, "command"};
    rtcf::Input<bool> done{this, "done"};
    rtcf::Input<bool> stopped{this, "stopped"};
    rtcf::Output<sensor_msgs::JointState> target{this, "target", "", rtcf::Finite()};
    rtcf::Output<bool> stop{this, "stop"};
    rtcf::Output<bool> reset{this, "reset"};

    rtcf::Parameter<Mode> mode{this,
                               "mode",
                               Mode::Stand,
                               rtcf::Choice("stand", Mode::Stand),
                               rtcf::Choice("tour", Mode::Tour),
                               rtcf::Choice("sliders", Mode::Sliders),
                               rtcf::Choice("joystick", Mode::Joystick),
                               rtcf::Choice("goal", Mode::Goal),
                               rtcf::Doc("source of targets: none, a tour of poses, joint1 to "
                                         "joint6, joy, or goal")};
    rtcf::Parameter<bool> emergency_stop{this, "emergency_stop", false,
                                         rtcf::Doc("true: stop; reset afterwards")};
    rtcf::Parameter<bool> reset_stop{this, "reset_stop", false,
                                     rtcf::Doc("a change to true resets an emergency stop")};
    std::array<std::unique_ptr<rtcf::Parameter<double>>, kJoints> sliders_ = makeSliders();
    rtcf::Parameter<double> pause{this,
                                  "pause",
                                  0.5,
                                  rtcf::Min(0.0),
                                  rtcf::Max(60.0),
                                  rtcf::Unit("s"),
                                  rtcf::Doc("time at each pose of the tour")};
    rtcf::Parameter<double> jog_speed{
        this,
        "jog_speed",
        0.6,
        rtcf::Min(0.0),
        rtcf::Max(3.0),
        rtcf::Unit("rad/s"),
        rtcf::Doc("velocity of a joint at full deflection of its axis of joy")};
    rtcf::Parameter<std::int64_t> enable_button{
        this,         "enable_button", 4,
        rtcf::Min(0), rtcf::Max(31),   rtcf::Doc("button of joy that must be held for a motion")};

    rtcf::State<bool> suspended_{this, "suspended", false,
                                 rtcf::Doc("no targets after a stop, until mode changes")};
    rtcf::State<Mode> last_mode_{this, "last_mode", Mode::Stand,
                                 rtcf::Doc("mode of the last cycle")};
    rtcf::State<std::uint32_t> pose_{this, "pose", 0, rtcf::Doc("next pose of the tour")};
    rtcf::State<double> waited_{this, "waited", 0.0, rtcf::Unit("s"),
                                rtcf::Doc("time since the last motion")};
    rtcf::State<bool> jogs_{this, "jogs", false, rtcf::Doc("the joystick moves the arm")};
    rtcf::State<Positions> aim_{
        this, "aim", {}, rtcf::Unit("rad"), rtcf::Doc("target of the joystick")};

    // Deflections of axes below it are none.
    static constexpr double kDeadBand = 0.1;
    // An older message of a joystick commands nothing.
    static constexpr std::int64_t kJoyTimeout = 300'000'000;  // ns
    // Distance of the joystick's target from the commanded position.
    static constexpr double kLead_s = 0.25;

    std::array<std::unique_ptr<rtcf::Parameter<double>>, kJoints> makeSliders() {
        static constexpr Positions kRange{2.9, 1.9, 2.5, 3.0, 2.0, 3.1};
        std::array<std::unique_ptr<rtcf::Parameter<double>>, kJoints> made;
        for (std::size_t i = 0; i < kJoints; ++i) {
            made[i] = std::make_unique<rtcf::Parameter<double>>(
                this, "joint" + std::to_string(i + 1), kTour[0][i], rtcf::Min(-kRange[i]),
                rtcf::Max(kRange[i]), rtcf::Unit("rad"),
                rtcf::Doc("target of the joint in the mode sliders"));
        }
        return made;
    }

    bool configure() override {
        sensor_msgs::JointState sample;
        for (std::size_t i = 0; i < kJoints; ++i)
            sample.name.push_back("joint" + std::to_string(i + 1));
        sample.position.resize(kJoints);
        target.reserve(sample);
        target.value() = sample;
        return true;
    }

    bool start() override {
        waited_ = 0.0;
        jogs_ = false;
        suspended_ = false;
        return true;
    }

    void update() override {
        command.read();
        const bool has_goal = goal.read() == rtcf::DataStatus::New;
        const bool stands = done.read() != rtcf::DataStatus::None && done.value();
        waited_ = stands ? waited_ + dt() : 0.0;
        stop.write(emergency_stop);
        reset.write(reset_stop);
        if (mode.value() != last_mode_.value()) suspended_ = false;
        if (stopped.read() != rtcf::DataStatus::None && stopped.value()) suspended_ = true;
        last_mode_ = mode.value();
        if (mode.value() != Mode::Joystick) jogs_ = false;
        if (suspended_) return;
        switch (mode.value()) {
            case Mode::Stand:
                break;
            case Mode::Tour:
                tour();
                break;
            case Mode::Sliders:
                slide();
                break;
            case Mode::Joystick:
                jog();
                break;
            case Mode::Goal:
                if (has_goal && fits(goal.value())) write(positionsOf(goal.value()));
                break;
        }
    }

    void tour() {
        if (waited_ < pause) return;
        waited_ = 0.0;
        pose_ = (pose_ + 1) % kTour.size();
        write(kTour[pose_]);
    }

    void slide() {
        Positions positions{};
        for (std::size_t i = 0; i < kJoints; ++i) positions[i] = *sliders_[i];
        write(positions);
    }

    // Moves the target with the axes, from the commanded position on, while the button is held.
    void jog() {
        const bool has_joy = joy.read() != rtcf::DataStatus::None && joy.age(this) < kJoyTimeout;
        const auto button = static_cast<std::size_t>(enable_button.value());
        const bool enabled = has_joy && button < joy.value().buttons.size() &&
                             joy.value().buttons[button] != 0 && fits(command.value());
        if (!enabled) {
            if (jogs_) write(positionsOf(command.value()));  // stops there
            jogs_ = false;
            return;
        }
        const Positions present = positionsOf(command.value());
        if (!jogs_) aim_ = present;
        jogs_ = true;
        for (std::size_t i = 0; i < kJoints; ++i) {
            const double deflection = i < joy.value().axes.size() ? joy.value().axes[i] : 0.0;
            if (!(std::abs(deflection) > kDeadBand)) continue;
            const double speed = jog_speed * std::clamp(deflection, -1.0, 1.0);
            const double lead = jog_speed * kLead_s;
            aim_.value()[i] =
                std::clamp(aim_.value()[i] + speed * dt(), present[i] - lead, present[i] + lead);
        }
        write(aim_);
    }

    static bool fits(const sensor_msgs::JointState& message) {
        return message.position.size() == kJoints;
    }
    static Positions positionsOf(const sensor_msgs::JointState& message) {
        Positions positions{};
        std::copy_n(message.position.begin(), kJoints, positions.begin());
        return positions;
    }
    void write(const Positions& positions) {
        std::copy(positions.begin(), positions.end(), target.value().position.begin());
        target.publish();
    }
};

}  // namespace
}  // namespace rtcf_arm

RTCF_COMPONENT_NAMED(rtcf_arm::Operator, "Operator",
                     "Panel of the arm: targets from a tour, sliders, a joystick or a topic; "
                     "emergency stop",
                     Operator)
