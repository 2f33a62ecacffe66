// JointStatePublisher and JointCommandSubscriber.
#include <gtest/gtest.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/String.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <rtcf/test.hpp>
#include <string>
#include <vector>

#include "control/allocations.hpp"
#include "control/numbers.hpp"

namespace rtcf::test {
namespace {

using Vector = std::vector<double>;
using Names = std::vector<std::string>;

sensor_msgs::JointState message(const Names& names, const Vector& position,
                                const Vector& velocity = {}, const Vector& effort = {}) {
    sensor_msgs::JointState state;
    state.name = names;
    state.position = position;
    state.velocity = velocity;
    state.effort = effort;
    return state;
}

std::string said(const Bench& bench) {
    const auto* const status = bench.read<std_msgs::String>("status");
    return status == nullptr ? "nothing" : status->data;
}

Bench::Parameters arm(Bench::Parameters more = {}) {
    more.insert(more.begin(), {"joints", std::string("shoulder elbow, wrist")});
    return more;
}

// A subscriber that has followed one message.
class Subscriber {
   public:
    explicit Subscriber(const Bench::Parameters& parameters = arm())
        : bench("JointCommandSubscriber", parameters) {
        bench.write("command", message({}, {0.1, 0.2, 0.3}));
        bench.cycle();
    }
    void follow(const sensor_msgs::JointState& command) {
        bench.write("command", command);
        bench.cycle();
    }
    Vector positions() const {
        return {*bench.read<double>("position1"), *bench.read<double>("position2"),
                *bench.read<double>("position3")};
    }
    std::uint32_t rejected() const { return *bench.read<std::uint32_t>("rejected"); }
    std::uint32_t missing() const { return *bench.read<std::uint32_t>("missing"); }

    Bench bench;
};

TEST(JointCommandSubscriber, FindsJointsByNameInAnyOrder) {
    Subscriber subscriber;
    subscriber.follow(message({"gripper", "wrist", "shoulder", "elbow"}, {9.0, 3.0, 1.0, 2.0},
                              {9.5, 3.5, 1.5, 2.5}, {kNaN, 30.0, 10.0, 20.0}));
    EXPECT_EQ(subscriber.positions(), (Vector{1.0, 2.0, 3.0}));
    EXPECT_EQ(*subscriber.bench.read<double>("velocity1"), 1.5);
    EXPECT_EQ(*subscriber.bench.read<double>("velocity3"), 3.5);
    EXPECT_EQ(*subscriber.bench.read<double>("effort2"), 20.0);
    EXPECT_EQ(subscriber.bench.read<double>("position4"), nullptr);
    EXPECT_EQ(subscriber.rejected(), 0U);
    EXPECT_EQ(said(subscriber.bench), "accepted");
}

TEST(JointCommandSubscriber, HasTheOrderOfItsParameterWithoutNames) {
    const Subscriber subscriber;
    EXPECT_EQ(subscriber.positions(), (Vector{0.1, 0.2, 0.3}));
    EXPECT_EQ(subscriber.bench.read<double>("velocity1"), nullptr);
    EXPECT_EQ(subscriber.bench.read<double>("effort1"), nullptr);
}

TEST(JointCommandSubscriber, WaitsForTheFirstMessage) {
    Bench bench("JointCommandSubscriber", arm());
    bench.cycle(3);
    EXPECT_EQ(bench.read<double>("position1"), nullptr);
    EXPECT_EQ(said(bench), "waiting: no message yet");
    EXPECT_EQ(*bench.read<std::uint32_t>("missing"), 3U);
    EXPECT_TRUE(bench.log().empty());
}

TEST(JointCommandSubscriber, WritesEachMessageOnce) {
    Subscriber subscriber;
    subscriber.bench.cycle(5);
    EXPECT_EQ(subscriber.bench.writes("position1"), 1U);
    EXPECT_EQ(subscriber.bench.writes("status"), 1U);
    subscriber.follow(message({}, {0.1, 0.2, 0.3}));
    EXPECT_EQ(subscriber.bench.writes("position1"), 2U);
    EXPECT_EQ(subscriber.bench.writes("status"), 1U);
}

TEST(JointCommandSubscriber, RejectsMessagesWithTheirReason) {
    Names many(1025, "other");
    const std::vector<std::pair<sensor_msgs::JointState, std::string>> bad{
        {message({"elbow", "other"}, {1.0, 2.0}), "rejected: missing in it: shoulder, wrist"},
        {message({"other"}, {1.0}), "rejected: missing in it: shoulder, elbow, wrist"},
        {message({"shoulder", "elbow", "wrist", "elbow"}, {1.0, 2.0, 3.0, 4.0}),
         "rejected: twice in it: elbow"},
        {message({}, {1.0, 2.0}), "rejected: it does not have one position of each joint"},
        {message({}, {1.0, 2.0, 3.0, 4.0}),
         "rejected: it does not have one position of each joint"},
        {message({"shoulder", "elbow", "wrist"}, {1.0, 2.0, 3.0}, {1.0}),
         "rejected: it does not have one velocity of each joint"},
        {message({}, {}, {}, {1.0}), "rejected: it does not have one effort of each joint"},
        {message({}, {}), "rejected: it has no position, velocity or effort"},
        {message({}, {1.0, kNaN, 3.0}), "rejected: not finite: position of elbow"},
        {message({}, {1.0, 2.0, 3.0}, {1.0, 2.0, -kInfinity}),
         "rejected: not finite: velocity of wrist"},
        {message({}, {1.0, 2.0, 3.0}, {}, {kInfinity, 2.0, 3.0}),
         "rejected: not finite: effort of shoulder"},
        {message(many, Vector(many.size(), 1.0)), "rejected: it has more than 1024 names"},
    };
    Subscriber subscriber;
    std::uint32_t count = 0;
    for (const auto& [command, why] : bad) {
        subscriber.bench.clock().time_ns = subscriber.bench.clock().time_ns + 2'000'000'000;
        subscriber.follow(command);
        EXPECT_EQ(said(subscriber.bench), why);
        EXPECT_EQ(subscriber.rejected(), ++count) << why;
        EXPECT_EQ(subscriber.bench.log().size(), count);
        EXPECT_EQ(subscriber.bench.log().back(), "command " + why);
        EXPECT_EQ(subscriber.positions(), (Vector{0.1, 0.2, 0.3}));
        EXPECT_EQ(subscriber.bench.read<double>("velocity1"), nullptr);
    }
    EXPECT_EQ(subscriber.bench.nonFinite(), 0U);
    many.resize(1021, "other");
    many.insert(many.end(), {"wrist", "elbow", "shoulder"});
    subscriber.follow(message(many, Vector(many.size(), 1.0)));
    EXPECT_EQ(said(subscriber.bench), "accepted");
    EXPECT_EQ(subscriber.positions(), (Vector{1.0, 1.0, 1.0}));
}

TEST(JointCommandSubscriber, NamesMissingJointsOncePerSecond) {
    Subscriber subscriber;
    for (int cycle = 0; cycle < 2500; ++cycle) subscriber.follow(message({"elbow"}, {1.0}));
    EXPECT_EQ(subscriber.rejected(), 2500U);
    EXPECT_EQ(subscriber.missing(), 2U);
    EXPECT_EQ(subscriber.bench.log().size(), 3U);
    EXPECT_EQ(subscriber.bench.writes("status"), 2U);
}

TEST(JointCommandSubscriber, AcceptsIncompleteMessagesIfTold) {
    Subscriber subscriber(arm({{"incomplete", std::string("accept")}}));
    subscriber.follow(message({"wrist", "elbow"}, {3.0, 2.0}));
    EXPECT_EQ(subscriber.positions(), (Vector{0.1, 2.0, 3.0}));
    EXPECT_EQ(said(subscriber.bench), "accepted without shoulder");
    EXPECT_EQ(subscriber.missing(), 1U);
    EXPECT_EQ(subscriber.rejected(), 0U);
    subscriber.follow(message({"other"}, {3.0}));
    EXPECT_EQ(subscriber.rejected(), 1U);
    subscriber.bench.set({{"incomplete", std::string("reject")}});
    subscriber.follow(message({"wrist", "elbow"}, {4.0, 4.0}));
    EXPECT_EQ(subscriber.rejected(), 2U);
    EXPECT_EQ(subscriber.positions(), (Vector{0.1, 2.0, 3.0}));
}

TEST(JointCommandSubscriber, HandsOverItsCount) {
    Subscriber subscriber;
    subscriber.follow(message({}, {kNaN, 0.0, 0.0}));
    Bench successor("JointCommandSubscriber", arm());
    successor.cycle();
    successor.takeOver(subscriber.bench);
    successor.write("command", message({}, {}));
    successor.cycle();
    EXPECT_EQ(*successor.read<std::uint32_t>("rejected"), 2U);
}

TEST(JointCommandSubscriber, PassesTheSafeCommandOn) {
    Subscriber subscriber;
    subscriber.bench.write("command", message({}, {7.0, 8.0, 9.0}));
    subscriber.bench.safe();
    EXPECT_EQ(subscriber.positions(), (Vector{7.0, 8.0, 9.0}));
}

TEST(JointCommandSubscriber, DoesNotAllocate) {
    Subscriber subscriber(arm({{"incomplete", std::string("accept")}}));
    const std::vector<sensor_msgs::JointState> commands{
        message({"wrist", "shoulder", "elbow"}, {3.0, 1.0, 2.0}),
        message({"wrist", "elbow"}, {3.0, 2.0}),
        message({"wrist", "wrist"}, {3.0, 2.0}),
        message(Names(2000, "other"), {}),
        message({}, {kNaN, 0.0, 0.0}),
    };
    for (const auto& command : commands) {
        subscriber.bench.write("command", command);
        EXPECT_EQ(allocationsInUpdate(subscriber.bench.component()), 0U);
    }
}

TEST(JointStatePublisher, CombinesTheValuesOfAllJoints) {
    Bench bench("JointStatePublisher", arm());
    bench.clock().stamp_ns = 12'000'000'034;
    for (int i = 1; i <= 3; ++i) {
        bench.write("position" + std::to_string(i), 0.1 * i);
        bench.write("effort" + std::to_string(i), 10.0 * i);
    }
    bench.write("position4", 99.0);  // there is no such joint
    bench.cycle();
    const auto& state = *bench.read<sensor_msgs::JointState>("state");
    EXPECT_EQ(state.name, (Names{"shoulder", "elbow", "wrist"}));
    EXPECT_EQ(state.position, (Vector{0.1, 0.2, 0.1 * 3}));
    EXPECT_TRUE(state.velocity.empty());
    EXPECT_EQ(state.effort, (Vector{10.0, 20.0, 30.0}));
    EXPECT_EQ(state.header.stamp.toNSec(), 12'000'000'034U);
    EXPECT_EQ(*bench.read<std::uint32_t>("missing"), 0U);
    EXPECT_EQ(said(bench), "complete");
    bench.cycle(9);
    EXPECT_EQ(bench.writes("state"), 10U);
    EXPECT_EQ(bench.writes("status"), 1U);
    EXPECT_TRUE(bench.log().empty());
}

TEST(JointStatePublisher, NamesJointsWithoutAValue) {
    Bench bench("JointStatePublisher", arm());
    bench.cycle(10);
    EXPECT_EQ(said(bench), "waiting: no input has a value");
    EXPECT_EQ(*bench.read<std::uint32_t>("missing"), 3U);
    EXPECT_TRUE(bench.log().empty());
    bench.write("velocity2", 1.0);
    bench.cycle(2500);
    EXPECT_EQ(said(bench), "no velocity of shoulder, wrist");
    EXPECT_EQ(*bench.read<std::uint32_t>("missing"), 2U);
    EXPECT_EQ(bench.log().size(), 3U);
    EXPECT_EQ(bench.log()[0], "state is not written: no velocity of shoulder, wrist");
    EXPECT_EQ(bench.read<sensor_msgs::JointState>("state"), nullptr);
    bench.write("velocity1", 1.0);
    bench.write("velocity3", 1.0);
    bench.cycle();
    EXPECT_EQ(said(bench), "complete");
    EXPECT_NE(bench.read<sensor_msgs::JointState>("state"), nullptr);
}

TEST(JointStatePublisher, CountsOldValuesAsMissing) {
    Bench bench("JointStatePublisher", arm({{"timeout", 0.005}}));
    for (int i = 1; i <= 3; ++i) bench.write("position" + std::to_string(i), 1.0);
    bench.cycle(6);
    EXPECT_EQ(bench.writes("state"), 6U);
    bench.write("position1", 1.0);
    bench.cycle();
    EXPECT_EQ(said(bench), "no position of elbow, wrist");
    EXPECT_EQ(bench.writes("state"), 6U);
}

TEST(JointStatePublisher, KeepsTheLastMessageWhileAValueIsNotFinite) {
    Bench bench("JointStatePublisher", arm());
    for (int i = 1; i <= 3; ++i) bench.write("position" + std::to_string(i), 1.0);
    bench.cycle();
    for (const double bad : {kNaN, kInfinity, -kInfinity}) {
        bench.write("position2", bad);
        bench.cycle();
        EXPECT_EQ(said(bench), "not finite: position of elbow");
    }
    EXPECT_EQ(bench.nonFinite(), 3U);
    EXPECT_EQ(bench.writes("state"), 1U);
    EXPECT_EQ(bench.read<sensor_msgs::JointState>("state")->position, (Vector{1.0, 1.0, 1.0}));
    bench.write("position2", 2.0);
    bench.cycle();
    EXPECT_EQ(bench.read<sensor_msgs::JointState>("state")->position, (Vector{1.0, 2.0, 1.0}));
}

TEST(JointStatePublisher, DoesNotAllocate) {
    Bench bench("JointStatePublisher", arm());
    bench.cycle();
    const auto publish = [&] {
        EXPECT_EQ(allocationsInUpdate(bench.component()), 0U);
        bench.cycle();
    };
    bench.write("position1", 1.0);
    publish();
    for (int i = 1; i <= 3; ++i) bench.write("position" + std::to_string(i), 1.0);
    publish();
    for (int i = 1; i <= 3; ++i) bench.write("velocity" + std::to_string(i), kNaN);
    publish();
    for (int i = 1; i <= 3; ++i) bench.write("velocity" + std::to_string(i), 1.0);
    publish();
    EXPECT_EQ(said(bench), "complete");
}

TEST(JointMessages, GoThereAndBackBitByBit) {
    std::string sixteen;
    for (int i = 0; i < 16; ++i) sixteen += "joint_" + std::to_string(i) + " ";
    Bench publisher("JointStatePublisher", {{"joints", sixteen}});
    Bench subscriber("JointCommandSubscriber", {{"joints", sixteen}});
    for (int cycle = 0; cycle < 50; ++cycle) {
        const auto value = [&](int i) { return std::sin(cycle + 0.1 * i) / 3.0; };
        for (int i = 1; i <= 16; ++i) publisher.write("effort" + std::to_string(i), value(i));
        publisher.cycle();
        subscriber.write("command", *publisher.read<sensor_msgs::JointState>("state"));
        subscriber.cycle();
        for (int i = 1; i <= 16; ++i)
            ASSERT_EQ(*subscriber.read<double>("effort" + std::to_string(i)), value(i));
    }
}

TEST(JointMessages, RejectParametersWithOneLine) {
    std::string seventeen;
    for (int i = 0; i < 17; ++i) seventeen += "j" + std::to_string(i) + ",";
    const std::vector<std::pair<std::string, std::string>> cases{
        {" , ", "joints has 0 names; write 1 to 16"},
        {seventeen, "joints has 17 names; write 1 to 16"},
        {"a b a", "joints has a twice"},
    };
    for (const std::string type : {"JointStatePublisher", "JointCommandSubscriber"}) {
        for (const auto& [joints, why] : cases) {
            try {
                const Bench bench(type, {{"joints", joints}});
                ADD_FAILURE() << why;
            } catch (const std::exception& error) {
                EXPECT_EQ(error.what(), "prepare failed: " + why);
            }
        }
        Bench bench(type, arm());
        bench.set(arm());
        EXPECT_THROW(bench.set({{"joints", std::string("a b")}}), std::invalid_argument);
    }
    EXPECT_THROW(Bench("JointStatePublisher", {{"timeout", -1.0}}), std::invalid_argument);
}

}  // namespace
}  // namespace rtcf::test
