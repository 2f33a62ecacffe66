#include <gtest/gtest.h>
#include <sensor_msgs/JointState.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <iomanip>
#include <iostream>
#include <random>
#include <rtcf/test.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "control/numbers.hpp"

namespace rtcf::test {
namespace {

using Vector = std::vector<double>;

// Limits of all joints, unless a test sets others.
constexpr double kVelocity = 2.0;
constexpr double kAcceleration = 4.0;
constexpr double kJerk = 16.0;

#ifdef RTCF_SANITIZED
constexpr int kTargets = 200;
#else
constexpr int kTargets = 1000;
#endif

sensor_msgs::JointState jointState(const Vector& position, const Vector& velocity = {},
                                   const std::vector<std::string>& names = {}) {
    sensor_msgs::JointState state;
    state.name = names;
    state.position = position;
    state.velocity = velocity;
    return state;
}

trajectory_msgs::JointTrajectoryPoint pointAt(double time, const Vector& positions,
                                              const Vector& velocities = {},
                                              const Vector& accelerations = {}) {
    trajectory_msgs::JointTrajectoryPoint point;
    point.time_from_start = ros::Duration(time);
    point.positions = positions;
    point.velocities = velocities;
    point.accelerations = accelerations;
    return point;
}

struct Sample {
    Vector position, velocity, acceleration;
};

// A component, which is at rest at some positions after its first cycle.
class Generator {
   public:
    explicit Generator(const Vector& start, Bench::Parameters parameters = {})
        : bench("TrajectoryGenerator", withDefaults(start.size(), std::move(parameters))) {
        bench.write("measured", jointState(start));
        bench.clock().stamp_ns = 1'000'000'000;
        bench.cycle();
    }

    static Bench::Parameters withDefaults(std::size_t joints, Bench::Parameters parameters) {
        std::string names;
        for (std::size_t i = 0; i < joints; ++i) names += "j" + std::to_string(i) + " ";
        Bench::Parameters all{{"joints", names},
                              {"velocity", std::string("2")},
                              {"acceleration", std::string("4")},
                              {"jerk", std::string("16")}};
        all.insert(all.end(), parameters.begin(), parameters.end());
        return all;
    }

    void target(const Vector& position, const Vector& velocity = {}) {
        bench.write("target", jointState(position, velocity));
    }
    // `begin` is the time from the next cycle to the stamp, s; NaN for no stamp.
    void trajectory(const std::vector<trajectory_msgs::JointTrajectoryPoint>& points,
                    double begin = kNaN) {
        trajectory_msgs::JointTrajectory message;
        message.points = points;
        if (!std::isnan(begin)) {
            message.header.stamp.fromNSec(
                static_cast<std::uint64_t>(bench.clock().stamp_ns + std::llround(1e9 * begin)));
        }
        bench.write("trajectory", message);
    }
    Sample next() {
        bench.cycle();
        return now();
    }
    Sample now() const {
        const auto& point = *bench.read<trajectory_msgs::JointTrajectoryPoint>("point");
        return {point.positions, point.velocities, point.accelerations};
    }
    bool done() const { return *bench.read<bool>("done"); }
    double progress() const { return *bench.read<double>("progress"); }
    std::uint32_t rejected() const { return *bench.read<std::uint32_t>("rejected"); }
    // Runs until done; returns the number of cycles.
    int finish(int most = 100000) {
        int cycles = 0;
        do {
            bench.cycle();
            ++cycles;
        } while (!done() && cycles < most);
        return cycles;
    }

    Bench bench;
};

// Fails if a joint moves from one sample to the next as limits do not allow.
void expectSmooth(const Sample& last, const Sample& now, double velocity = kVelocity,
                  double acceleration = kAcceleration, double jerk = kJerk) {
    const double h = kStep;
    for (std::size_t i = 0; i < now.position.size(); ++i) {
        ASSERT_LE(std::abs(now.velocity[i]), velocity * (1.0 + kRounding));
        ASSERT_LE(std::abs(now.acceleration[i]), acceleration * (1.0 + kRounding));
        ASSERT_LE(std::abs(now.acceleration[i] - last.acceleration[i]), jerk * h + 1e-8);
        ASSERT_LE(std::abs(now.velocity[i] - last.velocity[i] - h * last.acceleration[i]),
                  jerk * h * h / 2.0 + kRounding);
        ASSERT_LE(std::abs(now.position[i] - last.position[i] -
                           h * (last.velocity[i] + h / 2.0 * last.acceleration[i])),
                  jerk * h * h * h / 6.0 + kRounding);
    }
}

// Duration from rest to rest over a distance that reaches all limits.
double analyticDuration(double distance) {
    return distance / kVelocity + kVelocity / kAcceleration + kAcceleration / kJerk;
}

// Duration of the stop from the largest velocity.
constexpr double kStopDuration = kVelocity / kAcceleration + kAcceleration / kJerk;

TEST(TrajectoryGenerator, WritesNothingBeforeTheStartPositionIsKnown) {
    Bench bench("TrajectoryGenerator", Generator::withDefaults(2, {}));
    bench.write("target", jointState({1.0, 2.0}));
    bench.cycle();
    EXPECT_EQ(bench.read<sensor_msgs::JointState>("command"), nullptr);
    for (const auto& state :
         {jointState({0.5}), jointState({0.5, kNaN}), jointState({0.5, 0.5}, {}, {"j0", "j9"})}) {
        bench.write("measured", state);
        bench.cycle();
        EXPECT_EQ(bench.read<sensor_msgs::JointState>("command"), nullptr);
    }
    bench.write("measured", jointState({9.0, 0.25, 0.5}, {}, {"other", "j1", "j0"}));
    bench.cycle();
    const auto& command = *bench.read<sensor_msgs::JointState>("command");
    EXPECT_EQ(command.name, (std::vector<std::string>{"j0", "j1"}));
    // The target has waited.
    EXPECT_NEAR(command.position[0], 0.5, 1e-6);
    EXPECT_NEAR(command.position[1], 0.25, 1e-6);
    EXPECT_FALSE(*bench.read<bool>("done"));
}

TEST(TrajectoryGenerator, TakesTheAnalyticTimeToATargetAndStandsThere) {
    for (const double distance : {3.0, -5.5}) {
        Generator generator({1.0});
        EXPECT_TRUE(generator.done());
        generator.target({1.0 + distance});
        const double duration = analyticDuration(std::abs(distance));
        EXPECT_EQ(generator.finish(), static_cast<int>(std::ceil(duration / kStep - 1e-6)));
        EXPECT_EQ(generator.progress(), 1.0);
        const Sample end = generator.next();
        EXPECT_EQ(end.position[0], 1.0 + distance);
        EXPECT_EQ(end.velocity[0], 0.0);
        EXPECT_EQ(end.acceleration[0], 0.0);
    }
}

TEST(TrajectoryGenerator, MovesJointsTogether) {
    Generator generator({0.0, 0.0, 0.0});
    generator.target({3.0, 0.5, -1.0});
    const int cycles = static_cast<int>(analyticDuration(3.0) / kStep);
    generator.bench.cycle(static_cast<std::uint64_t>(cycles - 10));
    EXPECT_NEAR(generator.progress(), (cycles - 10) / (1000.0 * analyticDuration(3.0)), 1e-3);
    for (const double velocity : generator.now().velocity) EXPECT_NE(velocity, 0.0);
    generator.bench.cycle(11);
    EXPECT_EQ(generator.now().position, (Vector{3.0, 0.5, -1.0}));
}

TEST(TrajectoryGenerator, StaysWithinItsLimitsWhileTargetsChange) {
    for (const bool moving : {false, true}) {
        std::mt19937 random(29);
        std::uniform_real_distribution<double> position(-3.0, 3.0);
        std::uniform_real_distribution<double> velocity(-kVelocity, kVelocity);
        Generator generator({0.0, 0.5, -1.0});
        Sample last = generator.now();
        for (int i = 0; i < kTargets; ++i) {
            Vector targets;
            Vector velocities;
            for (int joint = 0; joint < 3; ++joint) {
                targets.push_back(position(random));
                if (moving) velocities.push_back(velocity(random));
            }
            generator.target(targets, velocities);
            for (auto cycles = random() % 500; cycles > 0; --cycles) {
                const Sample now = generator.next();
                ASSERT_NO_FATAL_FAILURE(expectSmooth(last, now)) << "target " << i;
                last = now;
            }
        }
        EXPECT_EQ(generator.rejected(), 0U);
        EXPECT_EQ(generator.bench.nonFinite(), 0U);
    }
}

TEST(TrajectoryGenerator, NeverPassesItsLimitsOfPosition) {
    std::mt19937 random(30);
    std::uniform_real_distribution<double> position(-1.5, 1.5);
    std::uniform_real_distribution<double> velocity(-kVelocity, kVelocity);
    Generator generator({0.0, 0.5},
                        {{"lower", std::string("-1")}, {"upper", std::string("1, 0.75")}});
    Sample last = generator.now();
    for (int i = 0; i < kTargets; ++i) {
        generator.target({position(random), position(random)},
                         i % 2 == 0 ? Vector() : Vector{velocity(random), velocity(random)});
        for (auto cycles = random() % 500; cycles > 0; --cycles) {
            const Sample now = generator.next();
            ASSERT_NO_FATAL_FAILURE(expectSmooth(last, now));
            for (std::size_t joint = 0; joint < 2; ++joint) {
                ASSERT_GE(now.position[joint], -1.0 - 1e-8);
                ASSERT_LE(now.position[joint], (joint == 0 ? 1.0 : 0.75) + 1e-8);
            }
            last = now;
        }
    }
    generator.finish();
    generator.target({7.0, -7.0});
    generator.finish();
    EXPECT_EQ(generator.now().position, (Vector{1.0, -1.0}));
}

TEST(TrajectoryGenerator, StopsBehindATargetWithAVelocity) {
    Generator generator({0.0});
    generator.target({2.0}, {kVelocity});
    Sample last = generator.now();
    bool passed = false;
    do {
        const Sample now = generator.next();
        ASSERT_NO_FATAL_FAILURE(expectSmooth(last, now));
        passed = passed || (std::abs(now.position[0] - 2.0) <= kVelocity * kStep &&
                            std::abs(now.velocity[0] - kVelocity) < 1e-3);
        last = now;
    } while (!generator.done());
    EXPECT_TRUE(passed);
    // The mean velocity of the stop is half of that at its start.
    EXPECT_NEAR(last.position[0], 2.0 + kVelocity / 2.0 * kStopDuration, kRounding);
    // A repeated message does not send it back.
    generator.target({2.0}, {kVelocity});
    EXPECT_EQ(generator.next().position, last.position);
}

TEST(TrajectoryGenerator, RejectsTargetsAndMovesOn) {
    Generator generator({0.0, 0.0});
    Generator undisturbed({0.0, 0.0});
    generator.target({3.0, 1.0});
    undisturbed.target({3.0, 1.0});
    generator.bench.cycle(100);
    undisturbed.bench.cycle(100);
    std::uint32_t count = 0;
    for (const auto& bad :
         {jointState({kNaN, 0.0}), jointState({0.0, 0.0}, {0.0, kNaN}), jointState({0.0}),
          jointState({0.0, 0.0}, {0.0}), jointState({0.0, 0.0}, {0.0, 2.1}), jointState({}),
          jointState({0.0, 0.0}, {}, {"j0", "x"}), jointState({0.0}, {}, {"j0", "j1"})}) {
        generator.bench.write("target", bad);
        EXPECT_EQ(generator.next().position, undisturbed.next().position);
        EXPECT_EQ(generator.rejected(), ++count);
    }
    EXPECT_EQ(generator.finish(), undisturbed.finish());
    generator.bench.write("target", jointState({5.0, 2.5, 2.0}, {}, {"x", "j1", "j0"}));
    generator.finish();
    EXPECT_EQ(generator.now().position, (Vector{2.0, 2.5}));
}

TEST(TrajectoryGenerator, HaltsOnTheFastestWay) {
    Generator generator({0.0});
    generator.target({10.0});
    generator.bench.cycle(1500);
    ASSERT_NEAR(generator.now().velocity[0], kVelocity, kRounding);
    const double from = generator.now().position[0];
    generator.bench.write("halt", true);
    EXPECT_EQ(generator.finish(), static_cast<int>(std::ceil(kStopDuration / kStep - 1e-6)));
    EXPECT_NEAR(generator.now().position[0], from + kVelocity / 2.0 * kStopDuration, kRounding);
    generator.target({10.0});
    generator.trajectory({pointAt(1.0, {2.0})});
    generator.bench.cycle();
    EXPECT_TRUE(generator.done());
    EXPECT_EQ(generator.rejected(), 2U);
    generator.bench.write("halt", false);
    generator.bench.cycle();
    EXPECT_TRUE(generator.done());
    generator.target({10.0});
    generator.finish();
    EXPECT_EQ(generator.now().position[0], 10.0);
}

TEST(TrajectoryGenerator, StandsWhereOthersMoveTheJointsUntilANewTarget) {
    Generator generator({0.0, 0.5});
    generator.target({1.0, 1.0});
    for (int i = 0; i < 300; ++i) generator.next();
    generator.bench.write("idle", true);
    for (const double moved : {0.31, 0.32, 0.3}) {
        generator.bench.write("measured", jointState({moved, 0.7}));
        const Sample stands = generator.next();
        EXPECT_EQ(stands.position, (Vector{moved, 0.7}));
        EXPECT_EQ(stands.velocity, (Vector{0.0, 0.0}));
    }
    generator.target({2.0, 2.0});
    EXPECT_EQ(generator.next().position, (Vector{0.3, 0.7}));
    EXPECT_EQ(generator.rejected(), 1U);
    generator.bench.write("idle", false);
    // It stands there, although the drives may sag, and goes on from there.
    generator.bench.write("measured", jointState({0.2, 0.7}));
    for (int i = 0; i < 100; ++i) EXPECT_EQ(generator.next().position, (Vector{0.3, 0.7}));
    generator.target({0.0, 0.0});
    const Sample first = generator.next();
    EXPECT_LT(first.position[0], 0.3);
    EXPECT_GT(first.position[0], 0.3 - 1e-6);
    generator.finish();
    EXPECT_NEAR(generator.now().position[0], 0.0, kRounding);
}

TEST(TrajectoryGenerator, RejectsWhatComesWhileItDoesNotKnowWhereTheJointsAre) {
    for (const std::string port : {"idle", "halt"}) {
        Bench bench("TrajectoryGenerator", Generator::withDefaults(1, {}));
        bench.write("measured", jointState({port == "idle" ? 0.0 : kNaN}));
        bench.cycle();
        bench.write("measured", jointState({kNaN}));
        bench.write(port, true);
        bench.cycle();
        trajectory_msgs::JointTrajectory message;
        message.points = {pointAt(1.0, {0.5})};
        for (int i = 0; i < 3; ++i) {
            bench.write("target", jointState({1.0}));
            bench.write("trajectory", message);
            bench.cycle();
        }
        EXPECT_EQ(*bench.read<std::uint32_t>("rejected"), 6U) << port;
        bench.write(port, false);
        bench.write("measured", jointState({0.3}));
        for (int i = 0; i < 5; ++i) {
            bench.cycle();
            EXPECT_EQ(bench.read<sensor_msgs::JointState>("command")->position, Vector{0.3});
            EXPECT_TRUE(*bench.read<bool>("done"));
        }
    }
}

TEST(TrajectoryGenerator, HaltsWhileIdleWithoutAMeasurement) {
    Bench bench("TrajectoryGenerator",
                Generator::withDefaults(1, {{"initial", std::string("0.5")}}));
    bench.write("target", jointState({1.0}));
    for (int i = 0; i < 100; ++i) bench.cycle();
    const double before = bench.read<sensor_msgs::JointState>("command")->position[0];
    bench.write("idle", true);
    for (int i = 0; i < 5000; ++i) bench.cycle();
    EXPECT_GT(bench.read<sensor_msgs::JointState>("command")->position[0], before);
    EXPECT_TRUE(*bench.read<bool>("done"));
    EXPECT_LT(bench.read<sensor_msgs::JointState>("command")->position[0], 1.0);
}

TEST(TrajectoryGenerator, FollowsLinearCubicAndQuinticSegments) {
    struct Case {
        Vector velocities, accelerations;
        double (*position)(double x);  // from rest at 0 to rest at 1, both in 1 s
    };
    for (const Case& each : {Case{{}, {}, [](double x) { return x; }},
                             Case{{0.0}, {}, [](double x) { return x * x * (3.0 - 2.0 * x); }},
                             Case{{0.0}, {0.0}, [](double x) {
                                      return x * x * x * (10.0 + x * (-15.0 + 6.0 * x));
                                  }}}) {
        Generator generator({0.0});
        generator.trajectory({pointAt(0.0, {0.0}, each.velocities, each.accelerations),
                              pointAt(1.0, {1.0}, each.velocities, each.accelerations),
                              pointAt(2.0, {0.0}, each.velocities, each.accelerations)});
        for (int i = 0; i <= 2000; ++i) {
            const double x = i <= 1000 ? i * kStep : 2.0 - i * kStep;
            ASSERT_NEAR(generator.next().position[0], each.position(x), kRounding) << i;
            ASSERT_EQ(generator.done(), i == 2000);
            ASSERT_NEAR(generator.progress(), i / 2000.0, kRounding);
        }
        EXPECT_EQ(generator.now().position[0], 0.0);
        EXPECT_EQ(generator.now().velocity[0], 0.0);
    }
}

TEST(TrajectoryGenerator, BeginsATrajectoryAtItsStamp) {
    Generator generator({0.0, 1.0});
    generator.trajectory({pointAt(0.1, {0.1, 1.1})}, 0.05);
    for (int i = 0; i <= 200; ++i) {
        const double moved = std::clamp((i - 50) * kStep, 0.0, 0.1);
        const Vector position = generator.next().position;
        ASSERT_NEAR(position[0], moved, kRounding);
        ASSERT_NEAR(position[1], 1.0 + moved, kRounding);
        ASSERT_EQ(generator.done(), i >= 150);
    }
    // Of one that has begun, the rest counts.
    generator.trajectory({pointAt(0.1, {7.0, 7.0}), pointAt(0.3, {0.2, 1.0})}, -0.2);
    generator.finish();
    EXPECT_EQ(generator.now().position, (Vector{0.2, 1.0}));
}

TEST(TrajectoryGenerator, ReplacesTheTailFromTheStampOn) {
    const auto first = {pointAt(0.5, {0.4}, {0.5}, {0.1}), pointAt(1.0, {0.2}, {0.0}, {0.0})};
    Generator generator({0.0});
    Generator undisturbed({0.0});
    generator.trajectory(first, 0.0);
    undisturbed.trajectory(first, 0.0);
    generator.bench.cycle(200);
    undisturbed.bench.cycle(200);
    // In the middle of the second segment, while the first one is under way.
    generator.trajectory({pointAt(0.0, {9.0}, {0.0}, {0.0}), pointAt(0.4, {0.6}, {0.0}, {0.0})},
                         0.5);
    Sample last = generator.now();
    for (int i = 0; i < 500; ++i) {
        last = generator.next();
        const Sample old = undisturbed.next();
        ASSERT_NEAR(last.position[0], old.position[0], kRounding);
        ASSERT_NEAR(last.velocity[0], old.velocity[0], kRounding);
    }
    while (!generator.done()) {
        const Sample now = generator.next();
        ASSERT_NO_FATAL_FAILURE(expectSmooth(last, now, 10.0, 100.0, 1000.0));
        last = now;
    }
    EXPECT_EQ(last.position[0], 0.6);
    EXPECT_EQ(generator.rejected(), 0U);
}

TEST(TrajectoryGenerator, FollowsActionChunksOfAPolicy) {
    // Each 20 ms a chunk of the next 200 ms, as a policy's, that begins 10 ms later. The points are
    // on a sine; a quintic polynomial between points 20 ms apart misses it by far less than 1e-9.
    const double turns = 2.0;
    const auto sine = [&](double time) {
        const double w = turns;
        return pointAt(time, {std::sin(w * time), std::cos(w * time)},
                       {w * std::cos(w * time), -w * std::sin(w * time)},
                       {-w * w * std::sin(w * time), -w * w * std::cos(w * time)});
    };
    Generator generator({0.0, 1.0}, {{"velocity", std::string("10")}});
    for (int cycle = 0; cycle < 4000; ++cycle) {
        const double now = cycle * kStep;
        if (cycle % 20 == 0 && cycle < 3900) {
            std::vector<trajectory_msgs::JointTrajectoryPoint> chunk;
            for (int k = 0; k < 10; ++k) {
                auto point = sine(now + 0.01 + 0.02 * k);
                point.time_from_start = ros::Duration(0.02 * k);
                chunk.push_back(point);
            }
            generator.trajectory(chunk, 0.01);
        }
        const Sample at = generator.next();
        if (cycle < 40 || cycle > 3890) continue;
        ASSERT_NEAR(at.position[0], std::sin(turns * now), 1e-8) << cycle;
        ASSERT_NEAR(at.position[1], std::cos(turns * now), 1e-8) << cycle;
        ASSERT_NEAR(at.velocity[0], turns * std::cos(turns * now), 1e-6) << cycle;
    }
    EXPECT_EQ(generator.rejected(), 0U);
}

TEST(TrajectoryGenerator, StopsWhereAChunkEndsInMotion) {
    Generator generator({0.0});
    generator.trajectory({pointAt(0.5, {0.4}, {1.5}, {0.0})});
    generator.bench.cycle(501);
    EXPECT_NEAR(generator.now().position[0], 0.4, kRounding);
    Sample last = generator.now();
    while (!generator.done()) {
        const Sample now = generator.next();
        ASSERT_NO_FATAL_FAILURE(expectSmooth(last, now));
        last = now;
    }
    EXPECT_NEAR(last.position[0], 0.4 + 1.5 / 2.0 * (1.5 / 4.0 + 4.0 / 16.0), kRounding);
}

TEST(TrajectoryGenerator, JoinsATrajectoryToATargetMotionAndBack) {
    Generator generator({0.0}, {{"velocity", std::string("10")}});
    generator.target({2.0});
    Sample last = generator.now();
    for (int cycle = 0; cycle < 3000; ++cycle) {
        if (cycle == 300) generator.trajectory({pointAt(0.6, {1.0}, {0.0}, {0.0})}, 0.1);
        if (cycle == 700) generator.target({0.0});
        const Sample now = generator.next();
        // The polynomial obeys no limits, and leaves an acceleration beyond its limit.
        const bool on_trajectory = cycle > 400 && cycle < 700;
        ASSERT_NO_FATAL_FAILURE(
            expectSmooth(last, now, 10.0, cycle > 400 ? 50.0 : 4.0, on_trajectory ? 1000.0 : 16.0))
            << cycle;
        last = now;
    }
    EXPECT_EQ(generator.now().position[0], 0.0);
}

TEST(TrajectoryGenerator, RejectsTrajectoriesAndMovesOn) {
    Generator generator({0.0}, {{"upper", std::string("5")}});
    std::uint32_t count = 0;
    std::vector<std::vector<trajectory_msgs::JointTrajectoryPoint>> bad{
        {pointAt(0.0, {0.0})},                       // past
        {pointAt(1.0, {5.1})},                       // position
        {pointAt(1.0, {2.1})},                       // velocity of the way there
        {pointAt(1.0, {1.0}), pointAt(1.1, {1.3})},  // velocity of a segment
        {pointAt(1.0, {1.0}, {-2.1})},               // velocity of the point
        {pointAt(1.0, {kNaN})},
        {pointAt(1.0, {0.0}, {kNaN})},
        {pointAt(1.0, {0.0}, {0.0}, {kNaN})},
        {pointAt(1.0, {0.0, 0.0})},  // sizes
        {pointAt(1.0, {0.0}, {0.0, 0.0})},
        {pointAt(1.0, {})},
        {pointAt(1.0, {0.0}), pointAt(1.0, {0.0})},  // times
        {pointAt(1.0, {0.0}), pointAt(0.5, {0.0})},
    };
    bad.emplace_back();
    for (int i = 0; i < 1024; ++i) bad.back().push_back(pointAt(1.0 + 0.1 * i, {0.0}));
    for (const auto& points : bad) {
        generator.trajectory(points);
        EXPECT_EQ(generator.next().position[0], 0.0);
        EXPECT_TRUE(generator.done());
        EXPECT_EQ(generator.rejected(), ++count);
    }
    bad.back().pop_back();
    generator.trajectory(bad.back());
    generator.bench.cycle();
    EXPECT_EQ(generator.rejected(), count);
}

TEST(TrajectoryGenerator, RejectsATrajectoryThatExceedsItsLimitsBetweenPoints) {
    // The cubic polynomial between these points is 1.5 times as fast as the mean velocity, and
    // leaves the limits of position, respectively.
    for (const auto& points :
         {std::vector<trajectory_msgs::JointTrajectoryPoint>{pointAt(1.0, {1.8}, {0.0})},
          std::vector<trajectory_msgs::JointTrajectoryPoint>{pointAt(1.0, {0.5}, {1.0}),
                                                             pointAt(2.0, {0.5}, {-1.0})}}) {
        Generator generator({0.0}, {{"upper", std::string("0.7")}});
        if (points.size() == 1) generator.bench.set({{"upper", std::string("9")}});
        generator.trajectory(points);
        EXPECT_EQ(generator.next().acceleration[0], 0.0);
        EXPECT_EQ(generator.rejected(), 1U);
        EXPECT_TRUE(generator.done());
    }
}

TEST(TrajectoryGenerator, StopsIfATrajectoryExceedsNewLimits) {
    for (const auto& [limit, value] : {std::pair{"velocity", "1"}, std::pair{"upper", "0.6"}}) {
        Generator generator({0.0});
        generator.trajectory({pointAt(1.0, {1.0}, {0.0})});
        generator.bench.cycle(300);
        ASSERT_GT(generator.now().velocity[0], 1.0);
        generator.bench.set({{limit, std::string(value)}});
        generator.finish();
        EXPECT_EQ(generator.rejected(), 1U);
        EXPECT_EQ(generator.now().velocity[0], 0.0);
        EXPECT_LE(generator.now().position[0], limit == std::string("velocity") ? 0.7 : 0.6);
    }
}

TEST(TrajectoryGenerator, LateCycleMovesOnByTenPeriodsAtMost) {
    Generator generator({0.0});
    generator.target({10.0});
    generator.bench.cycle(1500);
    const double before = generator.now().position[0];
    ASSERT_EQ(generator.now().velocity[0], kVelocity);
    generator.bench.clock().elapsed_ns = 600'000'000;
    EXPECT_NEAR(generator.next().position[0] - before, 10 * kStep * kVelocity, kRounding);
}

TEST(TrajectoryGenerator, StopsOnAnEmptyTrajectory) {
    Generator generator({0.0});
    generator.target({10.0});
    generator.bench.cycle(1500);
    generator.trajectory({});
    EXPECT_EQ(generator.finish(), static_cast<int>(std::ceil(kStopDuration / kStep - 1e-6)));
    EXPECT_EQ(generator.rejected(), 0U);
}

TEST(TrajectoryGenerator, ChangesLimitsWithoutAJump) {
    Generator generator({0.0});
    generator.target({5.0});
    generator.bench.cycle(800);
    Sample last = generator.now();
    generator.bench.set({{"velocity", std::string("1")}, {"jerk", std::string("8")}});
    for (int cycle = 0; !generator.done(); ++cycle) {
        const Sample now = generator.next();
        ASSERT_NO_FATAL_FAILURE(expectSmooth(last, now, cycle < 800 ? 2.0 : 1.0, 4.0, 8.0));
        last = now;
    }
    EXPECT_EQ(last.position[0], 5.0);
    // A target that has come to be beyond a limit is that limit.
    generator.target({0.0});
    generator.bench.cycle(100);
    generator.bench.set({{"lower", std::string("2")}});
    generator.finish();
    EXPECT_EQ(generator.now().position[0], 2.0);
}

TEST(TrajectoryGenerator, HandsOverMotionsToATarget) {
    Generator generator({0.0, 1.0});
    generator.target({5.0, 0.0}, {0.5, 0.0});
    generator.bench.cycle(700);
    Generator successor({0.0, 0.0});
    successor.bench.takeOver(generator.bench);
    for (int i = 0; i < 3000; ++i) {
        const Sample one = generator.next();
        const Sample other = successor.next();
        ASSERT_EQ(one.position, other.position);
        ASSERT_EQ(one.acceleration, other.acceleration);
    }
}

TEST(TrajectoryGenerator, StopsIfATrajectoryIsNotHandedOver) {
    Generator generator({0.0});
    generator.trajectory({pointAt(2.0, {2.0}, {0.0}, {0.0})});
    generator.bench.cycle(800);
    Generator successor({0.0});
    successor.bench.takeOver(generator.bench);
    Sample last = generator.now();
    do {
        const Sample now = successor.next();
        ASSERT_NO_FATAL_FAILURE(expectSmooth(last, now));
        last = now;
    } while (!successor.done());
    EXPECT_GT(last.position[0], generator.now().position[0]);
}

TEST(TrajectoryGenerator, EndsAtThePresentPositionOrTheEndOfTheStop) {
    for (const bool stop : {false, true}) {
        Generator generator({0.0}, {{"safe_position", std::string(stop ? "stop" : "present")}});
        generator.target({10.0});
        generator.bench.cycle(1500);
        const double from = generator.now().position[0];
        generator.bench.safe();
        EXPECT_NEAR(generator.now().position[0],
                    from + (stop ? kVelocity / 2.0 * kStopDuration : 0.0), kRounding);
        EXPECT_EQ(generator.now().velocity[0], 0.0);
        EXPECT_EQ(generator.now().acceleration[0], 0.0);
    }
}

TEST(TrajectoryGenerator, StartsAtInitialWithoutAMeasurement) {
    auto parameters = Generator::withDefaults(2, {{"initial", std::string("0.5, -1")}});
    Bench bench("TrajectoryGenerator", parameters);
    bench.cycle();
    ASSERT_NE(bench.read<sensor_msgs::JointState>("command"), nullptr);
    EXPECT_EQ(bench.read<sensor_msgs::JointState>("command")->position, (Vector{0.5, -1.0}));
}

TEST(TrajectoryGenerator, GivesTheSameNumbersTwice) {
    const auto run = [] {
        Generator generator({0.1, 0.2});
        Vector all;
        for (int cycle = 0; cycle < 3000; ++cycle) {
            if (cycle == 100) generator.target({1.0, -2.0}, {0.3, 0.1});
            if (cycle == 900) generator.trajectory({pointAt(1.0, {0.3, 0.1}, {0.0, 0.0})}, 0.2);
            if (cycle == 1500) generator.target({0.0, 1.0});
            const Sample now = generator.next();
            for (const Vector* each : {&now.position, &now.velocity, &now.acceleration})
                all.insert(all.end(), each->begin(), each->end());
        }
        return all;
    };
    const Vector one = run();
    const Vector other = run();
    EXPECT_EQ(std::memcmp(one.data(), other.data(), one.size() * sizeof(double)), 0);
}

TEST(TrajectoryGenerator, RejectsParametersWithOneLine) {
    const std::vector<std::pair<Bench::Parameters, std::string>> cases{
        {{{"joints", std::string("")}}, "joints has 0 names; write 1 to 16"},
        {{{"joints", std::string("a b a")}}, "joints has a twice"},
        {{{"velocity", std::string("1 2 3")}}, "velocity has 3 numbers; write one"},
        {{{"velocity", std::string("1 0")}}, "velocity: 0 is not finite and above 0"},
        {{{"acceleration", std::string("inf")}}, "acceleration: inf is not finite and above 0"},
        {{{"jerk", std::string("1m")}}, "jerk: 1m is not a number"},
        {{{"lower", std::string("2")}, {"upper", std::string("3 1")}},
         "joint j1: lower = 2 is above upper = 1"},
        {{{"upper", std::string("nan")}}, "upper: nan is not a number"},
        {{{"initial", std::string("0 inf")}}, "initial: inf is not finite"},
    };
    for (const auto& [parameters, said] : cases) {
        try {
            const Bench bench("TrajectoryGenerator", Generator::withDefaults(2, parameters));
            ADD_FAILURE() << said;
        } catch (const std::exception& error) {
            EXPECT_NE(std::string(error.what()).find(said), std::string::npos) << error.what();
        }
    }
    Generator generator({0.0, 0.0});
    EXPECT_THROW(generator.bench.set({{"joints", std::string("a b")}}), std::exception);
}

std::string exactly(double value) {
    std::ostringstream text;
    text << std::setprecision(17) << value;
    return text.str();
}

// Random trajectories, legal or not, chunks, targets and stops of 1 to 7 joints: from each state
// that they lead to, velocity and position stay within their limits, and a stop ends. RTCF_STOPS:
// number of stops.
TEST(TrajectoryGenerator, EveryStopStaysWithinTheLimitsOfVelocityAndPosition) {
    const char* const wanted = std::getenv("RTCF_STOPS");
    const int stops = wanted != nullptr ? std::stoi(wanted) : 2 * kTargets;
    std::mt19937_64 random(49);
    const auto between = [&](double low, double high) {
        return std::uniform_real_distribution<double>(low, high)(random);
    };
    double over_velocity = 0.0;  // largest excess, relative to the limit
    double over_position = 0.0;
    double longest = 0.0;  // stop, relative to V/A + A/J
    for (int done = 0; done < stops;) {
        const auto joints = static_cast<std::size_t>(between(1.0, 8.0));
        const double v = std::pow(10.0, between(-1.0, 1.0));
        const double a = v * std::pow(10.0, between(0.0, 1.5));
        const double j = a * std::pow(10.0, between(0.0, 2.0));
        const double lower = between(-1.0, -0.1);
        const double upper = between(0.1, 1.0);
        Generator generator(Vector(joints, 0.0), {{"velocity", exactly(v)},
                                                  {"acceleration", exactly(a)},
                                                  {"jerk", exactly(j)},
                                                  {"lower", exactly(lower)},
                                                  {"upper", exactly(upper)}});
        const auto run = [&](int most) {
            for (int cycle = 0; cycle < most; ++cycle) {
                const Sample now = generator.next();
                for (std::size_t i = 0; i < joints; ++i) {
                    over_velocity = std::max(over_velocity, std::abs(now.velocity[i]) / v - 1.0);
                    over_position =
                        std::max({over_position, lower - now.position[i], now.position[i] - upper});
                }
                if (over_velocity > 1e-5 || over_position > 1e-5 || generator.done()) return cycle;
            }
            return most;
        };
        const auto values = [&](double low, double high) {
            Vector all(joints);
            for (double& each : all) each = between(low, high);
            return all;
        };
        const auto follow = [&] {
            // Steps that take about the time that the velocity needs, and values of any size.
            std::vector<trajectory_msgs::JointTrajectoryPoint> points;
            Vector at = generator.now().position;
            double time = 0.0;
            const int kind = static_cast<int>(between(0.0, 3.0));
            const double reach = std::pow(10.0, between(-3.0, 0.0));
            for (int count = static_cast<int>(between(1.0, 8.0)); count > 0; --count) {
                double farthest = 0.0;
                for (double& each : at) {
                    const double to = std::clamp(each + reach * between(-1.0, 1.0), lower, upper);
                    farthest = std::max(farthest, std::abs(to - each));
                    each = to;
                }
                time += std::max(farthest / v * between(1.0, 2.0), 0.002);
                points.push_back(pointAt(time, at, kind > 0 ? values(-v, v) : Vector{},
                                         kind > 1 ? values(-30.0 * a, 30.0 * a) : Vector{}));
            }
            generator.trajectory(points);
        };
        for (int event = 0; event < 20; ++event) {
            const double choice = between(0.0, 1.0);
            if (choice < 0.6) {
                follow();
            } else if (choice < 0.8) {
                generator.target(values(lower, upper), values(-v, v));
            } else {
                generator.target(values(lower, upper));
            }
            run(static_cast<int>(between(1.0, 120.0)));
            if (between(0.0, 1.0) < 0.4) continue;  // the next one comes in the middle
            const bool halts = between(0.0, 1.0) < 0.5;
            if (halts) {
                generator.bench.write("halt", true);
            } else {
                generator.trajectory({});
            }
            const int most = static_cast<int>((4.0 * v / a + 8.0 * a / j) / kStep) + 100;
            const int cycles = run(most);
            ASSERT_TRUE(generator.done()) << "stop " << done << " runs away";
            longest = std::max(longest, cycles * kStep / (v / a + a / j));
            if (halts) generator.bench.write("halt", false);
            ++done;
            ASSERT_LE(over_velocity, 1e-8) << "before stop " << done;
            ASSERT_LE(over_position, 3.0 * kRounding) << "before stop " << done;
            for (std::size_t i = 0; i < joints; ++i) {
                ASSERT_EQ(generator.now().velocity[i], 0.0);
                ASSERT_EQ(generator.now().acceleration[i], 0.0);
            }
        }
    }
    RecordProperty("stops", stops);
    std::cout << stops << " stops: velocity " << over_velocity << " over its limit, position "
              << over_position << ", longest " << longest << " (V/A + A/J)\n";
}

TEST(TrajectoryGenerator, RejectsAJointThatIsTwiceInAMessage) {
    Generator generator({0.0, 0.0});
    generator.bench.write("target", jointState({1.0, 2.0, 3.0}, {}, {"j0", "j1", "j0"}));
    generator.next();
    EXPECT_EQ(generator.bench.log().back(),
              "target rejected: joint j0: it is twice in the message");
    trajectory_msgs::JointTrajectory message;
    message.joint_names = {"j1", "j1"};
    message.points = {pointAt(1.0, {0.1, 0.2})};
    generator.bench.write("trajectory", message);
    generator.next();
    EXPECT_EQ(generator.rejected(), 2U);
    EXPECT_TRUE(generator.done());
}

TEST(TrajectoryGenerator, RejectsMessagesOfAnySizeThatItCannotUse) {
    Generator generator({0.0});
    std::vector<trajectory_msgs::JointTrajectoryPoint> points;
    for (int i = 0; i <= 1024; ++i) points.push_back(pointAt(0.1 * (i + 1), {0.0}));
    generator.trajectory(points);
    generator.next();
    EXPECT_EQ(generator.rejected(), 1U);
    // The joint is beyond the names that are read.
    std::vector<std::string> names(1024, "other");
    names.emplace_back("j0");
    generator.bench.write("target", jointState(Vector(names.size(), 1.0), {}, names));
    generator.next();
    EXPECT_EQ(generator.rejected(), 2U);
    EXPECT_TRUE(generator.done());
    points.resize(1023);  // with the present motion, 1024
    generator.trajectory(points);
    generator.next();
    EXPECT_EQ(generator.rejected(), 2U);
}

}  // namespace
}  // namespace rtcf::test
