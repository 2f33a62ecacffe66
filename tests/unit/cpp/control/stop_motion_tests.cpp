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
        const double largest =
            std::max(task.limits.acceleration, std::abs(task.begin.acceleration));
        const double size =
            std::abs(task.begin.position) +
            (std::abs(task.begin.velocity) + largest * stop.duration()) * stop.duration();
        const double h = stop.duration() / 200;
        double lowest = task.begin.position;
        double highest = lowest;
        Motion last = task.begin;
        for (int i = 1; i <= 200; ++i) {
            const Motion now = stop.at(i < 200 ? i * h : stop.duration());
            ASSERT_LE(std::abs(now.acceleration), largest * (1.0 + 1e-9));
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

TEST(StopMotion, TakesNoLongerThanAMotionToItsEnd) {
    RandomTasks tasks(32);
    for (int n = 0; n < kTasks; ++n) {
        AxisTask task = tasks.any();
        const StopMotion stop(task.begin, task.limits);
        task.target = {stop.end(), 0.0};
        SynchronizedMotion motion;
        ASSERT_EQ(motion.plan(&task, 1), PlanError::None);
        ASSERT_LE(stop.duration(), motion.duration() * (1.0 + 1e-6) + 1e-9);
    }
}

}  // namespace
}  // namespace rtcf::test
