// Sensors that die, stay silent or are old, and controllers in front that compute NaN.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <rtcf/test.hpp>
#include <string>

#include "control/numbers.hpp"

namespace rtcf::test {
namespace {

Bench limiter(const std::string& command) {
    return Bench("JointLimiter", {{"command", command},
                                  {"lower", -1.0},
                                  {"upper", 1.0},
                                  {"deceleration", 4.0},
                                  {"max_velocity", 2.0},
                                  {"k_velocity", 10.0},
                                  {"max_effort", 20.0}});
}

// The joint follows its velocity; its sensor sends each `every`-th position, and none above `last`.
double farthest(int every, double last) {
    Bench bench = limiter("velocity");
    double x = -1.0;
    double top = x;
    for (int i = 0; i < 4000; ++i) {
        bench.write("in", 5.0);
        if (i % every == 0 && x <= last) bench.write("position", x);
        bench.cycle();
        x += kStep * *bench.read<double>("out");
        top = std::max(top, x);
    }
    EXPECT_EQ(*bench.read<double>("out"), 0.0);
    return top;
}

TEST(LostSensor, SlowOrDeadOneLetsNoJointCrossItsLimit) {
    EXPECT_NEAR(farthest(1, 2.0), 1.0, kRounding);
    for (const int every : {7, 100, 190}) EXPECT_LE(farthest(every, 2.0), 1.0 + kRounding) << every;
    for (const double last : {-0.9, 0.0, 0.5, 0.9, 0.99})
        EXPECT_LE(farthest(1, last), 1.0 + kRounding) << last;
}

TEST(LostSensor, EffortBrakesByTheWaySinceTheLastPosition) {
    Bench bench = limiter("effort");
    for (int i = 0; i < 100; ++i) {
        bench.write("in", 5.0);
        if (i == 0) bench.write("position", 0.9);
        bench.write("velocity", 0.8);  // 0.98 rad after 0.1 s, with 0.08 rad to brake
        bench.cycle();
    }
    EXPECT_LT(*bench.read<double>("out"), 0.0);
}

TEST(LostSensor, StopsAlsoIfTheCommandIsNotFinite) {
    for (const char* const command : {"effort", "velocity"}) {
        Bench bench = limiter(command);
        for (int i = 0; i < 300; ++i) {
            bench.write("in", 1.0);
            bench.write("position", -1.0 + 1e-3 * i);
            bench.write("velocity", 1.0);
            bench.cycle();
        }
        EXPECT_EQ(*bench.read<double>("out"), 1.0) << command;
        for (int i = 0; i < 600; ++i) {
            bench.write("in", kNaN);
            bench.cycle();
        }
        EXPECT_EQ(*bench.read<double>("out"), 0.0) << command;
    }
}

TEST(LostSensor, VelocityBrakesAtTheLimitIfTheCommandIsNotFinite) {
    Bench bench = limiter("velocity");
    double x = 0.0;
    for (int i = 0; i < 3000; ++i) {
        bench.write("in", i < 300 ? 1.0 : kNaN);
        bench.write("position", x);
        bench.cycle();
        x += kStep * *bench.read<double>("out");
    }
    EXPECT_NEAR(x, 1.0, kRounding);
    EXPECT_STREQ(bench.fault(), "in is not finite: the last output or target counts");
}

TEST(LostSensor, PositionThatWasNotNeededIsKnown) {
    Bench bench = limiter("effort");
    bench.write("in", 5.0);
    bench.write("position", 0.0);
    bench.write("velocity", 1.0);
    bench.cycle();
    bench.set({{"lower", -kInfinity}, {"upper", kInfinity}});
    bench.write("position", 0.99);
    bench.write("velocity", 1.0);
    bench.cycle();
    bench.set({{"lower", -1.0}, {"upper", 1.0}});
    bench.cycle();
    EXPECT_LT(*bench.read<double>("out"), 0.0);
}

TEST(LostSensor, AnotherCommandBeginsAtTheMeasuredPosition) {
    Bench bench("JointLimiter", {{"command", std::string("velocity")}, {"max_velocity", 2.0}});
    bench.write("in", 1.5);
    bench.write("position", 0.2);
    bench.cycle();
    bench.set({{"command", std::string("position")}});
    bench.write("in", 0.2);
    bench.cycle();
    EXPECT_EQ(*bench.read<double>("out"), 0.2);
}

// A value from long before counts by its true age, also after a reset of the state.
TEST(LostSensor, OldValueIsNotUsed) {
    Bench pid("Pid", {{"kp", 100.0}, {"safe_effort", 0.25}});
    pid.write("setpoint", 1.0);
    pid.write("measured", 0.0);
    pid.cycle(10);
    EXPECT_EQ(*pid.read<double>("effort"), 100.0);
    pid.cycle(300);
    EXPECT_EQ(*pid.read<double>("effort"), 0.25);
    for (const StateDeclaration& state : accessTo(pid.component()).states())
        std::memcpy(state.value, state.initial.data(), state.size);
    pid.cycle();
    EXPECT_EQ(*pid.read<double>("effort"), 0.25);

    Bench position = limiter("position");
    position.write("position", 0.5);
    position.cycle(300);
    position.write("in", 0.9);
    position.cycle();
    EXPECT_EQ(position.read<double>("out"), nullptr);
    position.write("position", 0.6);
    position.write("in", 0.9);
    position.cycle();
    EXPECT_NEAR(*position.read<double>("out"), 0.6, 1e-4);
}

TEST(LostSensor, ExcitationEndsAtTheLastFiniteCommand) {
    Bench bench("Excitation", {{"amplitude", 0.5}, {"lower", -1.0}, {"upper", 1.0}});
    bench.write("in", 0.25);
    bench.write("run", false);
    bench.cycle();
    bench.write("run", true);
    bench.cycle(10);
    EXPECT_EQ(*bench.read<double>("out"), 0.75);
    bench.write("in", kNaN);
    bench.cycle();
    EXPECT_EQ(*bench.read<double>("out"), 0.25);
    EXPECT_STREQ(bench.fault(), "in is not finite: out is its last finite value");
}

}  // namespace
}  // namespace rtcf::test
