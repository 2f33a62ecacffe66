#include "trajectory/farthest_motion.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "control/random_tasks.hpp"
#include "trajectory/velocity_change.hpp"

namespace rtcf::test {
namespace {

using namespace rtcf_control;

TEST(FarthestMotion, FromRestToRestRisesAndFallsWithTheCube) {
    const FarthestMotion farthest({}, 0.0, {100.0, 100.0, 1.0});
    EXPECT_EQ(farthest.fastest(), 0.0);
    EXPECT_NEAR(farthest.end(4.0).distance, 4.0 * 4.0 * 4.0 / 32.0, 1e-12);
    EXPECT_NEAR(farthest.end(4.0).slope, 3.0 * 4.0 * 4.0 / 32.0, 1e-12);
    EXPECT_NEAR(farthest.peakVelocity(4.0), 4.0 * 4.0 / 16.0, 1e-12);
}

TEST(FarthestMotion, SlopeIsTheDerivativeOfTheDistance) {
    RandomTasks tasks(1);
    for (int i = 0; i < kTasks; ++i) {
        const AxisTask task = tasks.moving();
        const FarthestMotion farthest(task.begin, task.target.velocity, task.limits);
        const double step = 1e-6 * farthest.linearFrom();
        const double duration =
            farthest.fastest() +
            tasks.between(0.01, 0.99) * (farthest.linearFrom() - farthest.fastest());
        if (duration - step < farthest.fastest() || duration + step > farthest.linearFrom())
            continue;
        const double slope =
            (farthest.end(duration + step).distance - farthest.end(duration - step).distance) /
            (2.0 * step);
        ASSERT_NEAR(farthest.end(duration).slope, slope, 1e-3 * task.limits.velocity) << i;
    }
}

TEST(FarthestMotion, RisesOrFallsOnlyBetweenTurningPoints) {
    RandomTasks tasks(2);
    for (int i = 0; i < kTasks; ++i) {
        const AxisTask task = tasks.moving();
        const FarthestMotion farthest(task.begin, task.target.velocity, task.limits);
        const FarthestMotion::TurningPoints turning = farthest.turningPoints();
        std::vector<double> ends{farthest.fastest()};
        ends.insert(ends.end(), turning.durations.begin(),
                    turning.durations.begin() + static_cast<std::ptrdiff_t>(turning.count));
        ends.push_back(farthest.linearFrom());
        ASSERT_TRUE(std::is_sorted(ends.begin(), ends.end())) << i;
        const double tolerance = 1e-9 * task.limits.velocity * farthest.linearFrom();
        for (std::size_t k = 0; k + 1 < ends.size(); ++k) {
            const double sign = std::copysign(
                1.0, farthest.end(ends[k + 1]).distance - farthest.end(ends[k]).distance);
            double last = farthest.end(ends[k]).distance;
            for (int part = 1; part <= 20; ++part) {
                const double now =
                    farthest.end(ends[k] + part / 20.0 * (ends[k + 1] - ends[k])).distance;
                ASSERT_GE(sign * (now - last), -tolerance) << i;
                last = now;
            }
        }
    }
}

// Any other motion of the same duration ends no farther.
TEST(FarthestMotion, EndsFartherThanMotionsByWayOfAnyVelocity) {
    RandomTasks tasks(3);
    int compared = 0;
    for (int i = 0; i < kTasks; ++i) {
        const AxisTask task = tasks.moving();
        const FarthestMotion farthest(task.begin, task.target.velocity, task.limits);
        const double velocity = tasks.between(-1.0, 1.0) * task.limits.velocity;
        const VelocityChange first(task.begin, velocity, task.limits);
        const VelocityChange second({0.0, velocity, 0.0}, task.target.velocity, task.limits);
        const double wait = tasks.between(0.0, 1.0);
        const double duration = first.duration() + wait + second.duration();
        ASSERT_GE(duration, farthest.fastest() * (1.0 - 1e-12)) << i;
        const double distance = first.distance() + velocity * wait + second.distance();
        ASSERT_GE(farthest.end(duration).distance,
                  distance - 1e-12 * task.limits.velocity * duration)
            << i;
        ++compared;
    }
    EXPECT_EQ(compared, kTasks);
}

TEST(FarthestMotion, LastsAsLongAsAsked) {
    RandomTasks tasks(4);
    for (int i = 0; i < kTasks; ++i) {
        const AxisTask task = tasks.moving();
        const FarthestMotion farthest(task.begin, task.target.velocity, task.limits);
        const double duration =
            farthest.fastest() + tasks.between(0.0, 2.0) * farthest.linearFrom();
        ASSERT_NEAR(farthest.phases(duration).duration(), duration, 1e-12 * duration) << i;
        const Motion end = farthest.phases(duration).motionAfter(task.begin);
        ASSERT_NEAR(end.velocity, task.target.velocity, 1e-10 * task.limits.velocity) << i;
        ASSERT_EQ(end.acceleration, 0.0) << i;
    }
}

}  // namespace
}  // namespace rtcf::test
