// A joint that follows the velocity or position of a JointLimiter, until it stands at its limit.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <rtcf/test.hpp>
#include <string>
#include <vector>

#include "control/numbers.hpp"

namespace rtcf::test {
namespace {

struct Motion {
    std::vector<double> speeds;
    double position = 0.0;
};

// Runs a joint that follows its velocity; the command is 2 rad/s.
Motion follow(Bench& bench, int cycles, const std::function<void(int, double)>& check = {}) {
    Motion motion;
    for (int cycle = 0; cycle < cycles; ++cycle) {
        if (check) check(cycle, motion.position);
        bench.write("in", 2.0);
        bench.write("position", motion.position);
        bench.cycle();
        motion.speeds.push_back(*bench.read<double>("out"));
        motion.position += kStep * motion.speeds.back();
    }
    return motion;
}

Bench velocityLimiter(double upper) {
    return Bench("JointLimiter",
                 {{"command", std::string("velocity")}, {"upper", upper}, {"deceleration", 5.0}});
}

TEST(JointLimiter, JointThatFollowsItsVelocityStopsAtTheLimit) {
    Bench bench = velocityLimiter(1.0);
    const Motion motion = follow(bench, 1200);
    EXPECT_NEAR(motion.position, 1.0, kRounding);
    for (int i = 400; i < 500; ++i) EXPECT_EQ(motion.speeds[i], 2.0);
    // It slows down by 5 * 1 ms in each cycle, from 2.0 to 0: 400 cycles.
    int slowing = 0;
    for (std::size_t i = 1; i < motion.speeds.size(); ++i) {
        const double slower = motion.speeds[i - 1] - motion.speeds[i];
        EXPECT_LE(std::abs(slower), 0.005 + kRounding);
        slowing += slower > 0.005 - kRounding ? 1 : 0;
    }
    EXPECT_GE(slowing, 398);
}

TEST(JointLimiter, LimitThatComesTooLateIsKeptByHarderBraking) {
    Bench bench = velocityLimiter(9.0);
    double upper = 9.0;
    const Motion motion = follow(bench, 900, [&](int cycle, double position) {
        if (cycle == 400) {
            upper = position + 0.2;
            bench.set({{"upper", upper}});
        }
        EXPECT_LE(position, upper + kRounding);
    });
    double hardest = 0.0;
    for (std::size_t i = 401; i < motion.speeds.size(); ++i)
        hardest = std::max(hardest, motion.speeds[i - 1] - motion.speeds[i]);
    EXPECT_NEAR(hardest, 0.01, 0.0002);  // 2 rad/s within 0.2 rad: 10 rad/s^2
    EXPECT_NEAR(motion.position, upper, 1e-3);
}

TEST(JointLimiter, BeyondALimitItBrakesByTheDeceleration) {
    Bench bench("JointLimiter", {{"upper", 9.0}, {"deceleration", 5.0}});
    bench.write("in", 9.0);
    bench.write("position", 0.0);
    bench.cycle(400);
    const double before = *bench.read<double>("out");
    bench.set({{"upper", before - 0.1}});
    std::vector<double> positions;
    for (int i = 0; i < 1500; ++i) {
        bench.cycle();
        positions.push_back(*bench.read<double>("out"));
    }
    for (std::size_t i = 2; i < positions.size(); ++i) {
        const double change = positions[i] - 2.0 * positions[i - 1] + positions[i - 2];
        EXPECT_LE(std::abs(change), 5.0 * kStep * kStep + kRounding);
    }
    const double farthest = *std::max_element(positions.begin(), positions.end());
    EXPECT_NEAR(farthest, before + 0.4, 3e-3);  // v^2 / (2 a)
    EXPECT_NEAR(positions.back(), before - 0.1, kRounding);
}

}  // namespace
}  // namespace rtcf::test
