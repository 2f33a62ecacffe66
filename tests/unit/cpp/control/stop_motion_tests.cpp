#include "trajectory/stop_motion.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "control/random_tasks.hpp"

namespace rtcf::test {
namespace {

using namespace rtcf_control;

TEST(StopMotion, TakesTheAnalyticTimeAndDistance) {
    // From a velocity that needs the largest acceleration, and from one that does not. The mean
    // velocity is half of that at the start.
    const StopMotion fast({1.0, 2.0, 0.0}, {5.0, 4.0, 16.0});
    EXPECT_NEAR(fast.duration(), 2.0 / 4.0 + 4.0 / 16.0, 1e-14);
    EXPECT_NEAR(fast.end(), 1.0 + 1.0 * fast.duration(), 1e-14);
    const StopMotion slow({1.0, -0.25, 0.0}, {5.0, 4.0, 16.0});
    EXPECT_NEAR(slow.duration(), 2.0 * std::sqrt(0.25 / 16.0), 1e-14);
    EXPECT_NEAR(slow.end(), 1.0 - 0.125 * slow.duration(), 1e-14);
    const StopMotion none({1.0, 0.0, 0.0}, {5.0, 4.0, 16.0});
    EXPECT_EQ(none.duration(), 0.0);
    EXPECT_EQ(none.at(0.0).position, 1.0);
}

TEST(StopMotion, StaysWithinItsLimitsAndRange) {
    RandomTasks tasks(31);
    for (int n = 0; n < kTasks; ++n) {
        const AxisTask task = tasks.any();
        const StopMotion stop(task.begin, task.limits);
        const PositionRange range = stop.range();
        const double largest = task.limits.acceleration;
        const double size =
            std::abs(task.begin.position) +
            (std::abs(task.begin.velocity) + largest * stop.duration()) * stop.duration();
        const double h = stop.duration() / 200;
        double lowest = task.begin.position;
        double highest = lowest;
        Motion last = stop.at(0.0);
        const double fastest =
            std::max(task.limits.velocity, std::abs(task.begin.velocity)) * (1.0 + 1e-8);
        for (int i = 1; i <= 200; ++i) {
            const Motion now = stop.at(i < 200 ? i * h : stop.duration());
            ASSERT_LE(std::abs(now.acceleration), largest * (1.0 + 1e-9));
            ASSERT_LE(std::abs(now.velocity), fastest);
            ASSERT_LE(std::abs(now.acceleration - last.acceleration),
                      task.limits.jerk * h * (1.0 + 1e-9) + 1e-9 * largest);
            ASSERT_NEAR(now.position - last.position, h * (now.velocity + last.velocity) / 2.0,
                        task.limits.jerk * h * h * h + 1e-9 * size);
            lowest = std::min(lowest, now.position);
            highest = std::max(highest, now.position);
            last = now;
        }
        ASSERT_EQ(last.velocity, 0.0);
        ASSERT_NEAR(last.position, stop.end(), 1e-9 * size);
        // Samples miss the extremes by no more than the motion of half a step.
        ASSERT_GE(lowest, range.lower - 1e-9 * size);
        ASSERT_LE(highest, range.upper + 1e-9 * size);
        ASSERT_NEAR(lowest, range.lower, largest * h * h + 1e-9 * size);
        ASSERT_NEAR(highest, range.upper, largest * h * h + 1e-9 * size);
    }
}

// Any velocity and acceleration, up to some hundred times the limits.
TEST(StopMotion, NeverPassesTheLimitsOfVelocityAndPosition) {
    RandomTasks tasks(33);
    for (int n = 0; n < 10 * kTasks; ++n) {
        AxisTask task = tasks.any();
        const double size = std::pow(10.0, tasks.between(-4.0, 0.5));
        PositionRange allowed{-size * tasks.between(0.0, 1.0), size * tasks.between(0.0, 1.0)};
        // Seldom beyond a limit of position, often at one.
        const double place = tasks.between(-0.2, 1.2);
        task.begin.position =
            allowed.lower + (allowed.upper - allowed.lower) *
                                (tasks.chance(0.8) ? std::clamp(place, 0.0, 1.0) : place);
        if (tasks.chance(0.7)) task.begin.acceleration *= std::pow(10.0, tasks.between(-1.0, 2.5));
        if (tasks.chance(0.2)) task.begin.velocity *= 3.0;
        const double speed = std::abs(task.begin.velocity);
        const double braking = speed * speed / (2.0 * task.limits.acceleration);
        // A limit that the axis has left, moving away: it goes no farther than the hardest stop.
        PositionRange most = allowed;
        if (task.begin.position > allowed.upper)
            most.upper = task.begin.position + (task.begin.velocity > 0.0 ? braking : 0.0);
        if (task.begin.position < allowed.lower)
            most.lower = task.begin.position - (task.begin.velocity < 0.0 ? braking : 0.0);

        const StopMotion stop(task.begin, task.limits, allowed);
        const double rounding = 1e-11 * (1.0 + std::abs(task.begin.position));
        const double fastest = std::max(task.limits.velocity, speed) * (1.0 + 1e-8);
        // The time of a stop that eases an allowed acceleration first.
        const MotionLimits& limits = task.limits;
        ASSERT_LE(stop.duration(), 2.0 * fastest / limits.acceleration +
                                       4.0 * limits.acceleration / limits.jerk +
                                       4.0 * std::sqrt(fastest / limits.jerk));
        Motion last = stop.at(0.0);
        ASSERT_EQ(last.position, task.begin.position);
        for (int i = 0; i <= 100; ++i) {
            const Motion now = stop.at(i < 100 ? i * stop.duration() / 100 : stop.duration());
            ASSERT_LE(std::abs(now.velocity), fastest);
            ASSERT_GE(now.position, most.lower - rounding);
            ASSERT_LE(now.position, most.upper + rounding);
            last = now;
        }
        ASSERT_EQ(last.velocity, 0.0);
        ASSERT_EQ(last.acceleration, 0.0);
        // Within the limits where they can all hold.
        if (!(task.begin.position < allowed.lower || task.begin.position > allowed.upper)) {
            const PositionRange passed = stop.range();
            ASSERT_GE(passed.lower, allowed.lower - rounding);
            ASSERT_LE(passed.upper, allowed.upper + rounding);
        }
    }
}

TEST(StopMotion, LeavesOutJerkFirstAndThenAcceleration) {
    const MotionLimits limits{1.0, 4.0, 40.0};
    // The velocity would rise to 1 + 50² / 80.
    const StopMotion fast({0.0, 1.0, 50.0}, limits);
    EXPECT_EQ(fast.at(0.0).acceleration, 0.0);
    // 1 / (2 * 4) suffices without the limit of jerk.
    const StopMotion hard({0.0, 1.0, 0.0}, limits, {-1.0, 0.126});
    EXPECT_LE(hard.end(), 0.126);
    EXPECT_GE(hard.at(0.5 * hard.duration()).acceleration, -4.0 * (1.0 + 1e-9));
    // Nothing but a larger deceleration suffices.
    const StopMotion harder({0.0, 1.0, 0.0}, limits, {-1.0, 0.05});
    EXPECT_DOUBLE_EQ(harder.end(), 0.05);
    EXPECT_DOUBLE_EQ(harder.at(0.0).acceleration, -10.0);
    // Beyond the limit already.
    const StopMotion beyond({0.2, 1.0, 0.0}, limits, {-1.0, 0.1});
    EXPECT_DOUBLE_EQ(beyond.end(), 0.2 + 0.125);
    const StopMotion back({0.2, -1.0, 0.0}, limits, {-1.0, 0.1});
    EXPECT_DOUBLE_EQ(back.end(), StopMotion({0.2, -1.0, 0.0}, limits).end());
}

TEST(StopMotion, TakesNoLongerThanAMotionToItsEnd) {
    RandomTasks tasks(32);
    for (int n = 0; n < kTasks; ++n) {
        AxisTask task = tasks.any();
        task.begin = withAllowedAcceleration(task.begin, task.limits);
        const StopMotion stop(task.begin, task.limits);
        task.target = {stop.end(), 0.0};
        SynchronizedMotion motion;
        ASSERT_EQ(motion.plan(&task, 1), PlanError::None);
        ASSERT_LE(stop.duration(), motion.duration() * (1.0 + 1e-6) + 1e-9);
    }
}

}  // namespace
}  // namespace rtcf::test
