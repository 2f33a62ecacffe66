// Finite values, and the types for which finiteness can be checked.
#include <geometry_msgs/Twist.h>
#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <string>
#include <vector>

#include "rtcf/eigen_type.hpp"
#include "support/bare_component.hpp"

namespace rtcf::test {

struct Command {
    std::uint32_t joint = 0;
    double torque = 0.0;
    std::array<float, 2> limits{};
    Eigen::Vector3d direction = Eigen::Vector3d::Zero();
    template <typename Visit>
    void fields(Visit&& visit) {
        visit("joint", joint);
        visit("torque", torque);
        visit("limits", limits);
        visit("direction", direction);
    }
};
struct Commands {
    Command first;
    Command second;
    template <typename Visit>
    void fields(Visit&& visit) {
        visit("first", first);
        visit("second", second);
    }
};
struct Nameless {
    double torque;
};
enum class Shift { Low, High };

// A component's own type used as a port type.
static_assert(std::is_trivially_copyable_v<Nameless>);
static_assert(!detail::IsCheckable<Nameless>::value, "an output of it is not declared Finite");
static_assert(!detail::IsCheckable<std::vector<Nameless>>::value);
static_assert(!detail::IsCheckable<std::array<Nameless, 2>>::value);
static_assert(detail::IsCheckable<Command>::value);
static_assert(detail::IsCheckable<std::vector<Command>>::value);
static_assert(detail::IsCheckable<double>::value);
static_assert(detail::IsCheckable<Shift>::value);
static_assert(detail::IsCheckable<std::string>::value);
static_assert(detail::IsCheckable<Eigen::Vector3d>::value);
static_assert(detail::IsCheckable<Eigen::Quaterniond>::value);
static_assert(detail::IsCheckable<Eigen::Isometry3d>::value);
static_assert(detail::IsCheckable<geometry_msgs::Twist>::value);

}  // namespace rtcf::test

// Structs with Eigen types are not trivially copyable, and are sent as messages.
struct CommandsOnRos {
    static const char* name() { return "Commands"; }
    static void toMessage(const rtcf::test::Commands& value, geometry_msgs::Twist& message) {
        message.linear.x = value.first.torque;
        message.angular.x = value.second.torque;
    }
    static void fromMessage(const geometry_msgs::Twist& message, rtcf::test::Commands& value) {
        value.first.torque = message.linear.x;
        value.second.torque = message.angular.x;
    }
};
template <>
struct rtcf::PortType<rtcf::test::Commands>
    : rtcf::MappedPortType<rtcf::test::Commands, geometry_msgs::Twist, CommandsOnRos> {};

namespace rtcf::test {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(FiniteCheck, ChecksEachFieldOfAStruct) {
    EXPECT_TRUE(detail::isFinite(Command{}));
    Command command;
    command.torque = kNan;
    EXPECT_FALSE(detail::isFinite(command));
    command = {};
    command.limits[1] = static_cast<float>(kInfinity);
    EXPECT_FALSE(detail::isFinite(command));
    command = {};
    command.direction.y() = -kInfinity;
    EXPECT_FALSE(detail::isFinite(command));
}

TEST(FiniteCheck, ChecksNestedStructsAndLists) {
    Commands pair;
    EXPECT_TRUE(detail::isFinite(pair));
    pair.second.torque = kNan;
    EXPECT_FALSE(detail::isFinite(pair));
    EXPECT_FALSE(detail::isFinite(std::vector<Command>{Command{}, pair.second}));
}

TEST(FiniteCheck, KeepsAStructFromReaders) {
    BareComponent component;
    Output<Commands> out{&component, "out", "", Finite()};
    Commands pair;
    pair.first.torque = 1.0;
    out.write(pair);
    EXPECT_TRUE(portOf(component, out).commit());
    pair.second.torque = kInfinity;
    accessTo(component).setTime(component.time() + 1);
    out.write(pair);
    EXPECT_FALSE(portOf(component, out).commit());
    const auto& seen = static_cast<const Slot<Commands>&>(*portOf(component, out).slot()).value;
    EXPECT_EQ(seen.first.torque, 1.0);
    EXPECT_EQ(seen.second.torque, 0.0);
}

}  // namespace
}  // namespace rtcf::test
