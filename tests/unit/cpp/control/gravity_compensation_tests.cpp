#include <gtest/gtest.h>
#include <sensor_msgs/JointState.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <rtcf/test.hpp>
#include <string>
#include <utility>
#include <vector>

#include "control/allocations.hpp"

namespace rtcf::test {
namespace {

using Vector = std::vector<double>;
using Names = std::vector<std::string>;

constexpr double kGravity = 9.80665;
constexpr double kRounding = 1e-12;  // of efforts of size 1 to 100
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

std::string link(const std::string& name, double mass = 0.0, const std::string& center = "0 0 0") {
    return "<link name='" + name + "'><inertial><origin xyz='" + center + "'/><mass value='" +
           std::to_string(mass) +
           "'/><inertia ixx='0' ixy='0' ixz='0' iyy='0' iyz='0' izz='0'/></inertial></link>";
}
std::string joint(const std::string& name, const std::string& type, const std::string& parent,
                  const std::string& child, const std::string& origin = "0 0 0",
                  const std::string& axis = "0 -1 0", const std::string& more = "") {
    return "<joint name='" + name + "' type='" + type + "'><origin xyz='" + origin +
           "'/><parent link='" + parent + "'/><child link='" + child + "'/><axis xyz='" + axis +
           "'/><limit lower='-3' upper='3' effort='9' velocity='9'/>" + more + "</joint>";
}
std::string robot(const std::string& parts) { return "<robot name='r'>" + parts + "</robot>"; }

// Two links in the vertical plane: lengths 1 and 0.8, centres of mass at 0.4 and 0.3.
const std::string kArm =
    robot(link("base") + link("upper", 3.0, "0.4 0 0") + link("fore", 2.0, "0.3 0 0") +
          joint("shoulder", "continuous", "base", "upper") +
          joint("elbow", "revolute", "upper", "fore", "1 0 0"));
// The same with a gripper of 0.5 at the end of the fore arm, whose fingers weigh 0.1 each.
const std::string kGripper =
    robot(link("base") + link("upper", 3.0, "0.4 0 0") + link("fore", 2.0, "0.3 0 0") +
          joint("shoulder", "continuous", "base", "upper") +
          joint("elbow", "revolute", "upper", "fore", "1 0 0") + link("gripper", 0.5) +
          joint("flange", "fixed", "fore", "gripper", "0.8 0 0") + link("left", 0.1) +
          link("right", 0.1) + joint("finger1", "prismatic", "gripper", "left") +
          joint("finger2", "prismatic", "gripper", "right"));

sensor_msgs::JointState at(const Vector& position, const Names& names = {}) {
    sensor_msgs::JointState state;
    state.name = names;
    state.position = position;
    return state;
}

// The component, with the efforts of its last cycle.
class Gravity {
   public:
    explicit Gravity(const std::string& urdf, Bench::Parameters more = {})
        : bench("GravityCompensation", with(urdf, std::move(more))) {}

    static Bench::Parameters with(const std::string& urdf, Bench::Parameters more) {
        more.insert(more.begin(), {"urdf", urdf});
        return more;
    }
    Vector hold(const Vector& position, const Names& names = {}) {
        bench.write("measured", at(position, names));
        bench.cycle();
        return efforts();
    }
    Vector efforts() const { return bench.read<sensor_msgs::JointState>("command")->effort; }
    Names names() const { return bench.read<sensor_msgs::JointState>("command")->name; }
    std::uint32_t rejected() const { return *bench.read<std::uint32_t>("rejected"); }

    Bench bench;
};

// By hand.
Vector twoLinks(double shoulder, double elbow, double at_end = 0.0, double gravity = kGravity) {
    const double fore = gravity * (2.0 * 0.3 + at_end * 0.8) * std::cos(shoulder + elbow);
    return {gravity * (3.0 * 0.4 + (2.0 + at_end) * 1.0) * std::cos(shoulder) + fore, fore};
}

void expectNear(const Vector& found, const Vector& expected) {
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], expected[i], kRounding);
}

std::string whyNot(const std::string& urdf, Bench::Parameters more = {}) {
    try {
        const Gravity gravity(urdf, std::move(more));
    } catch (const std::exception& error) {
        return error.what();
    }
    return "accepted";
}

TEST(GravityCompensation, HoldsTwoLinksAsByHand) {
    Gravity gravity(kArm);
    for (int i = 0; i < 17; ++i) {
        for (int j = 0; j < 15; ++j) {
            const double shoulder = -3.0 + 0.37 * i;
            const double elbow = -3.0 + 0.41 * j;
            expectNear(gravity.hold({shoulder, elbow}), twoLinks(shoulder, elbow));
        }
    }
    EXPECT_EQ(gravity.names(), (Names{"shoulder", "elbow"}));
}

TEST(GravityCompensation, HoldsPrismaticJoints) {
    // A lift, and a slide at 30 degrees on it.
    Gravity gravity(
        robot(link("base") + link("lift", 5.0, "1 2 3") + link("slide", 2.0, "3 2 1") +
              joint("z", "prismatic", "base", "lift", "0 0 1", "0 0 2") +
              joint("s", "prismatic", "lift", "slide", "1 0 0", "0.8660254037844386 0 0.5")));
    for (const double position : {-1.0, 0.0, 2.0})
        expectNear(gravity.hold({position, -position}), {7.0 * kGravity, 2.0 * kGravity * 0.5});
}

TEST(GravityCompensation, FindsJointsByNameInAnyOrder) {
    Gravity gravity(kArm);
    expectNear(gravity.hold({9.0, 0.2, 0.1}, {"other", "elbow", "shoulder"}), twoLinks(0.1, 0.2));
    Gravity reordered(kArm, {{"joints", std::string("elbow shoulder")}});
    const Vector expected = twoLinks(0.1, 0.2);
    expectNear(reordered.hold({0.2, 0.1}), {expected[1], expected[0]});
    EXPECT_EQ(reordered.names(), (Names{"elbow", "shoulder"}));
}

TEST(GravityCompensation, CountsLinksThatTheChainBears) {
    Gravity gravity(kGripper, {{"tip", std::string("fore")}});
    expectNear(gravity.hold({0.3, -0.4}), twoLinks(0.3, -0.4, 0.7));
    ASSERT_EQ(gravity.bench.log().size(), 2U);
    EXPECT_EQ(gravity.bench.log()[0],
              "joint finger1 is not in the chain: its links count at position 0");
    Gravity by_joints(kGripper, {{"joints", std::string("shoulder elbow")}});
    expectNear(by_joints.hold({0.3, -0.4}), twoLinks(0.3, -0.4, 0.7));
    Gravity from_upper(kGripper, {{"base", std::string("upper")}, {"tip", std::string("gripper")}});
    expectNear(from_upper.hold({0.5}), {twoLinks(0.0, 0.5, 0.7)[1]});
}

TEST(GravityCompensation, HasItsGravityFromParameters) {
    Gravity gravity(kArm, {{"gravity_z", -1.62}, {"share", 0.5}});
    const Vector moon = twoLinks(0.1, 0.2, 0.0, 1.62);
    expectNear(gravity.hold({0.1, 0.2}), {moon[0] / 2.0, moon[1] / 2.0});
    // Upside down, and lying: along -x, the arm at 90 degrees is as the horizontal one.
    Gravity hanging(kArm, {{"gravity_z", kGravity}});
    const Vector upright = twoLinks(0.1, 0.2);
    expectNear(hanging.hold({0.1, 0.2}), {-upright[0], -upright[1]});
    const double quarter = std::acos(0.0);
    Gravity lying(kArm, {{"gravity_x", -kGravity}, {"gravity_z", 0.0}});
    expectNear(lying.hold({0.1 - quarter, 0.2}), twoLinks(0.1, 0.2));
}

TEST(GravityCompensation, RejectsMessagesAndKeepsItsEfforts) {
    const std::vector<std::pair<sensor_msgs::JointState, std::string>> bad{
        {at({1.0, 2.0}, {"shoulder", "other"}), "joint elbow: not in the message"},
        {at({1.0, 2.0, 3.0}, {"elbow", "shoulder", "elbow"}), "joint elbow: twice in the message"},
        {at({kNaN, 0.0}), "joint shoulder: the position is not finite"},
        {at({0.0, std::numeric_limits<double>::infinity()}),
         "joint elbow: the position is not finite"},
        {at({1.0}), "it does not have one position of each joint"},
        {at({1.0, 2.0, 3.0}), "it does not have one position of each joint"},
        {at({}), "it does not have one position of each joint"},
        {at(Vector(1025, 0.0), Names(1025, "other")), "it has more than 1024 names"},
    };
    Gravity gravity(kArm);
    gravity.bench.write("measured", at({}));
    gravity.bench.cycle();
    EXPECT_EQ(gravity.bench.read<sensor_msgs::JointState>("command"), nullptr);
    std::uint32_t count = 1;
    const Vector before = gravity.hold({0.1, 0.2});
    for (const auto& [message, why] : bad) {
        gravity.bench.clock().time_ns = gravity.bench.clock().time_ns + 2'000'000'000;
        gravity.bench.write("measured", message);
        gravity.bench.cycle();
        EXPECT_EQ(gravity.rejected(), ++count) << why;
        EXPECT_EQ(gravity.bench.log().back(), "measured rejected: " + why);
        EXPECT_EQ(gravity.efforts(), before);
    }
    EXPECT_EQ(gravity.bench.nonFinite(), 0U);
}

TEST(GravityCompensation, ChangesItsParametersWithoutAJump) {
    Gravity gravity(kArm, {{"fade", 0.1}});
    const double before = gravity.hold({0.1, 0.2})[0];
    gravity.bench.set({{"gravity_z", -1.62}});
    const double after = twoLinks(0.1, 0.2, 0.0, 1.62)[0];
    for (int cycle = 0; cycle <= 100; ++cycle) {
        gravity.bench.cycle();
        EXPECT_NEAR(gravity.efforts()[0], before + (after - before) * cycle / 100.0, 1e-10);
        if (cycle == 50) gravity.bench.set({{"fade", 0.1}});  // changes nothing
    }
    gravity.bench.set({{"fade", 0.0}, {"share", 0.5}});
    gravity.bench.cycle();
    EXPECT_NEAR(gravity.efforts()[0], after / 2.0, kRounding);
}

TEST(GravityCompensation, HandsOverToAnotherRobotWithoutAJump) {
    Gravity gravity(kArm, {{"fade", 0.1}});
    const Vector before = gravity.hold({0.1, 0.2});
    Gravity same(kArm, {{"fade", 0.1}});
    same.bench.cycle();
    same.bench.takeOver(gravity.bench);
    same.bench.cycle();
    EXPECT_EQ(same.efforts(), before);
    Gravity loaded(kGripper, {{"fade", 0.1}, {"tip", std::string("fore")}});
    loaded.bench.cycle();
    loaded.bench.takeOver(gravity.bench);
    const Vector after = twoLinks(0.1, 0.2, 0.7);
    for (int cycle = 1; cycle <= 110; ++cycle) {
        loaded.bench.cycle();
        const double share = std::min(1.0, cycle / 100.0);
        EXPECT_NEAR(loaded.efforts()[0], before[0] + (after[0] - before[0]) * share, 1e-10);
    }
    // A state with other joints is not used.
    Gravity other(kArm, {{"joints", std::string("elbow shoulder")}});
    other.bench.cycle();
    other.bench.takeOver(gravity.bench);
    other.bench.cycle();
    EXPECT_EQ(other.bench.read<sensor_msgs::JointState>("command"), nullptr);
}

TEST(GravityCompensation, HoldsInTheLastCycle) {
    Gravity gravity(kArm);
    const Vector before = gravity.hold({0.1, 0.2});
    gravity.bench.safe();
    EXPECT_EQ(gravity.efforts(), before);
}

TEST(GravityCompensation, GivesTheSameNumbersTwice) {
    const auto run = [] {
        Gravity gravity(kGripper, {{"tip", std::string("fore")}});
        Vector all;
        for (int cycle = 0; cycle < 500; ++cycle) {
            if (cycle == 200) gravity.bench.set({{"gravity_x", 1.0}});
            const Vector now = gravity.hold({std::sin(0.1 * cycle), std::cos(0.03 * cycle)});
            all.insert(all.end(), now.begin(), now.end());
        }
        return all;
    };
    const Vector one = run();
    const Vector other = run();
    EXPECT_EQ(std::memcmp(one.data(), other.data(), one.size() * sizeof(double)), 0);
}

TEST(GravityCompensation, DoesNotAllocate) {
    Gravity gravity(kGripper, {{"tip", std::string("fore")}});
    gravity.bench.cycle();
    const auto allocations = [&](const sensor_msgs::JointState& message) {
        gravity.bench.write("measured", message);
        return allocationsInUpdate(gravity.bench.component());
    };
    EXPECT_EQ(allocations(at({0.1, 0.2})), 0U);
    gravity.bench.set({{"gravity_x", 1.0}, {"gravity_y", 1.0}});
    EXPECT_EQ(allocations(at({0.3, 0.2}, {"elbow", "shoulder"})), 0U);
    EXPECT_EQ(allocations(at({0.3}, {"elbow"})), 0U);
    EXPECT_EQ(allocations(at({kNaN, 0.0})), 0U);
}

TEST(GravityCompensation, RejectsRobotsWithOneLine) {
    const std::string two = link("base") + link("upper", 1.0);
    std::string long_arm = link("l0");
    for (int i = 0; i < 17; ++i) {
        const std::string next = "l" + std::to_string(i + 1);
        long_arm += link(next, 1.0) +
                    joint("j" + std::to_string(i), "continuous", "l" + std::to_string(i), next);
    }
    const std::vector<std::pair<std::string, std::string>> robots{
        {"<robot", "configure failed: the URDF cannot be read: "},
        {"<other/>", "configure failed: the URDF cannot be read: "},
        {robot(""), "configure failed: the URDF cannot be read: "},
        {robot(link("base")), "configure failed: no joint moves between base and tip"},
        {robot(two + joint("j", "fixed", "base", "upper")),
         "configure failed: no joint moves between base and tip"},
        {robot(two + joint("j", "floating", "base", "upper")),
         "configure failed: joint j is neither revolute, continuous, prismatic nor fixed: choose "
         "base and tip without it"},
        {robot(two + joint("j", "revolute", "base", "upper", "0 0 0", "0 0 0")),
         "configure failed: joint j: its axis is 0"},
        {robot(two + joint("j", "revolute", "base", "nowhere")),
         "configure failed: the URDF cannot be read: "},
        {robot(link("base") + link("upper", -1.0) + joint("j", "revolute", "base", "upper")),
         "configure failed: link upper: its mass -1 is not finite and 0 or above"},
        {robot(two + link("fore") + joint("i", "revolute", "base", "upper") +
               joint("j", "revolute", "upper", "fore", "0 0 0", "0 1 0", "<mimic joint='i'/>")),
         "configure failed: joint j mimics i: choose base and tip without it"},
        {robot(long_arm), "configure failed: 17 joints move between base and tip; at most 16 may"},
        {kGripper,
         "configure failed: the robot branches at link gripper, to left and right: set tip"},
        {"/nowhere/arm.urdf",
         "configure failed: urdf: cannot read /nowhere/arm.urdf: No such file or directory"},
        {"/tmp", "configure failed: urdf: cannot read /tmp: Is a directory"},
        {"",
         "configure failed: urdf is empty, and without ROS there is no parameter "
         "robot_description: set urdf"},
    };
    for (const auto& [urdf, why] : robots) {
        const std::string found = whyNot(urdf);
        EXPECT_EQ(found.substr(0, why.size()), why);
        EXPECT_EQ(found.find('\n'), std::string::npos) << found;
    }
}

TEST(GravityCompensation, RejectsALinkThatTheLibraryLeavesOut) {
    const std::string moments = "ixx='0' ixy='0' ixz='0' iyy='0' iyz='0' izz='0'";
    const std::string mass = "<mass value='1'/>";
    const std::vector<std::pair<std::string, std::string>> inertials{
        {"<mass value='abc'/><inertia " + moments + "/>", "abc"},
        {"<mass value=''/><inertia " + moments + "/>", "mass"},
        {"<mass value='nan'/><inertia " + moments + "/>", "nan"},
        {"<mass/><inertia " + moments + "/>", "mass"},
        {"<inertia " + moments + "/>", "mass"},
        {mass, "inertia"},
        {mass + "<inertia ixx='1'/>", "inertia"},
        {mass + "<inertia ixx='x' ixy='0' ixz='0' iyy='0' iyz='0' izz='0'/>", "inertia"},
        {mass + "<inertia ixx='-1' ixy='0' ixz='0' iyy='0' iyz='0' izz='0'/>", "-1"},
    };
    for (const auto& [inertial, value] : inertials) {
        const std::string found =
            whyNot(robot(link("base") + "<link name='upper'><inertial>" + inertial +
                         "</inertial></link>" + joint("j", "revolute", "base", "upper")));
        EXPECT_NE(found.find("upper"), std::string::npos) << inertial << ": " << found;
        EXPECT_NE(found.find(value), std::string::npos) << inertial << ": " << found;
        EXPECT_EQ(found.find('\n'), std::string::npos) << found;
    }
}

TEST(GravityCompensation, RejectsSelectionsWithOneLine) {
    const auto text = [](const char* value) { return std::string(value); };
    const std::vector<std::pair<Bench::Parameters, std::string>> cases{
        {{{"joints", text("shoulder elbow wrist")}},
         "configure failed: joints: wrist is not in the URDF"},
        {{{"joints", text("shoulder flange")}}, "configure failed: joints: flange is fixed"},
        {{{"joints", text("shoulder")}, {"tip", text("fore")}},
         "configure failed: joints lacks elbow, which is between base and tip"},
        {{{"joints", text("shoulder elbow finger1")}, {"tip", text("fore")}},
         "configure failed: joints: finger1 is not between base and tip"},
        {{{"joints", text("elbow elbow")}}, "prepare failed: joints has elbow twice"},
        {{{"tip", text("hand")}}, "configure failed: tip: link hand is not in the URDF"},
        {{{"base", text("floor")}}, "configure failed: base: link floor is not in the URDF"},
        {{{"base", text("fore")}, {"tip", text("upper")}},
         "configure failed: there is no path from base fore to tip upper"},
        {{{"base", text("fore")}, {"tip", text("fore")}},
         "configure failed: no joint moves between base and tip"},
        {{{"urdf", text("")}, {"description", text("")}},
         "prepare failed: urdf and description are empty: set one of them"},
    };
    for (const auto& [parameters, why] : cases) EXPECT_EQ(whyNot(kGripper, parameters), why);
    Gravity gravity(kArm);
    EXPECT_THROW(gravity.bench.set({{"tip", text("upper")}}), std::invalid_argument);
    gravity.bench.set({{"tip", text("")}, {"gravity_z", -1.0}});
}

}  // namespace
}  // namespace rtcf::test
