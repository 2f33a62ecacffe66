#include "trajectory/synchronized_motion.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include "control/random_tasks.hpp"

namespace rtcf::test {
namespace {

using namespace rtcf_control;

constexpr int kSamples = 200;

SynchronizedMotion planned(const std::vector<AxisTask>& tasks, double least_duration = 0.0) {
    SynchronizedMotion motion;
    EXPECT_EQ(motion.plan(tasks.data(), tasks.size(), least_duration), PlanError::None);
    return motion;
}

std::uint64_t bitsOf(double value) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &value, sizeof(bits));
    return bits;
}

double durationOf(const AxisTask& task) { return planned({task}).duration(); }

// Fails if a motion leaves its limits, jumps, or ends elsewhere. `largest` are the limits, or more
// if the start makes more unavoidable.
void expectSmooth(const SynchronizedMotion& motion, std::size_t axis, const AxisTask& task,
                  double largest_velocity, double largest_acceleration) {
    const double duration = motion.duration();
    const double h = duration / kSamples;
    const double j = task.limits.jerk;
    const double size = std::abs(task.begin.position) + std::abs(task.target.position) +
                        largest_velocity * duration;
    Motion last = motion.at(axis, 0.0);
    ASSERT_EQ(last.position, task.begin.position);
    ASSERT_EQ(last.velocity, task.begin.velocity);
    ASSERT_EQ(last.acceleration, task.begin.acceleration);
    for (int i = 1; i <= kSamples; ++i) {
        const Motion now = motion.at(axis, i < kSamples ? i * h : duration);
        ASSERT_LE(std::abs(now.velocity), largest_velocity * (1.0 + 1e-9));
        ASSERT_LE(std::abs(now.acceleration), largest_acceleration * (1.0 + 1e-9));
        // The steps of the largest jerk in the time.
        const double da = now.acceleration - last.acceleration;
        const double dv = now.velocity - last.velocity - h * last.acceleration;
        const double dp =
            now.position - last.position - h * (last.velocity + h / 2.0 * last.acceleration);
        ASSERT_LE(std::abs(da), j * h + 1e-9 * largest_acceleration);
        ASSERT_LE(std::abs(dv), j * h * h / 2.0 + 1e-9 * largest_velocity);
        ASSERT_LE(std::abs(dp), j * h * h * h / 6.0 + 1e-9 * size);
        last = now;
    }
    const Motion error = motion.axis(axis).roundingError();
    ASSERT_LE(std::abs(error.position), 1e-11 * size);
    ASSERT_LE(std::abs(error.velocity), 1e-11 * largest_velocity);
    ASSERT_EQ(last.position, task.target.position);
    ASSERT_EQ(last.velocity, task.target.velocity);
    ASSERT_EQ(last.acceleration, 0.0);
}

TEST(SynchronizedMotion, TakesTheAnalyticDurationFromRestToRest) {
    // At most the jerk reaches its limit; jerk and acceleration do; all three do.
    EXPECT_NEAR(durationOf({{0, 0, 0}, {1.0, 0.0}, {100.0, 100.0, 4.0}}), std::cbrt(32.0 / 4.0),
                1e-12);
    EXPECT_NEAR(durationOf({{0, 0, 0}, {10.0, 0.0}, {100.0, 2.0, 8.0}}),
                2.0 / 8.0 + std::sqrt(2.0 * 2.0 / 64.0 + 4.0 * 10.0 / 2.0), 1e-12);
    EXPECT_NEAR(durationOf({{0, 0, 0}, {-10.0, 0.0}, {3.0, 2.0, 8.0}}),
                10.0 / 3.0 + 3.0 / 2.0 + 2.0 / 8.0, 1e-12);
}

TEST(SynchronizedMotion, StopsInTheAnalyticTime) {
    const AxisTask task{{0.0, 2.0, 0.0}, {2.0 * (2.0 + 0.5) / 2.0, 0.0}, {2.0, 1.0, 2.0}};
    EXPECT_NEAR(durationOf(task), 2.0 / 1.0 + 1.0 / 2.0, 1e-12);
}

TEST(SynchronizedMotion, LastsNoTimeAtTheTarget) {
    const AxisTask task{{5.0, 0.0, 0.0}, {5.0, 0.0}, {1.0, 1.0, 1.0}};
    const SynchronizedMotion motion = planned({task});
    EXPECT_EQ(motion.duration(), 0.0);
    EXPECT_EQ(motion.at(0, 1.0).position, 5.0);
}

TEST(SynchronizedMotion, ObeysLimitsAndHasNoJumps) {
    RandomTasks random(1);
    for (int i = 0; i < kTasks; ++i) {
        std::vector<AxisTask> tasks(static_cast<std::size_t>(1 + i % 3));
        for (AxisTask& task : tasks) task = random.moving();
        const SynchronizedMotion motion = planned(tasks);
        for (std::size_t axis = 0; axis < tasks.size(); ++axis) {
            ASSERT_NO_FATAL_FAILURE(expectSmooth(motion, axis, tasks[axis],
                                                 tasks[axis].limits.velocity,
                                                 tasks[axis].limits.acceleration))
                << i << " " << axis;
        }
    }
}

TEST(SynchronizedMotion, BringsAStateBeyondTheLimitsBackWithoutExceedingFurther) {
    RandomTasks random(2);
    for (int i = 0; i < kTasks; ++i) {
        const AxisTask task = random.excessive();
        const SynchronizedMotion motion = planned({task});
        // Easing the acceleration leads to that velocity, at the latest.
        const double velocity = std::max({task.limits.velocity, std::abs(task.begin.velocity),
                                          std::abs(task.begin.easedVelocity(task.limits.jerk))});
        const double acceleration =
            std::max(task.limits.acceleration, std::abs(task.begin.acceleration));
        ASSERT_NO_FATAL_FAILURE(expectSmooth(motion, 0, task, velocity, acceleration)) << i;
        // Once within the limits, it stays there.
        bool velocity_within = false;
        bool acceleration_within = false;
        const double eased = std::abs(task.begin.easedVelocity(task.limits.jerk));
        for (int k = 0; k <= kSamples; ++k) {
            const Motion now = motion.at(0, k * motion.duration() / kSamples);
            if (acceleration_within) {
                ASSERT_LE(std::abs(now.acceleration), task.limits.acceleration * (1.0 + 1e-9)) << i;
            }
            if (velocity_within && eased <= task.limits.velocity) {
                ASSERT_LE(std::abs(now.velocity), task.limits.velocity * (1.0 + 1e-9)) << i;
            }
            acceleration_within =
                acceleration_within || std::abs(now.acceleration) <= task.limits.acceleration;
            velocity_within = velocity_within || std::abs(now.velocity) <= task.limits.velocity;
        }
    }
}

TEST(SynchronizedMotion, EndsWithAllAxesAtTheSameTime) {
    RandomTasks random(3);
    for (int i = 0; i < kTasks / 10; ++i) {
        std::vector<AxisTask> tasks(SynchronizedMotion::kMostAxes);
        for (AxisTask& task : tasks) task = random.any();
        const SynchronizedMotion motion = planned(tasks);
        double longest = 0.0;
        for (std::size_t axis = 0; axis < tasks.size(); ++axis) {
            ASSERT_EQ(motion.axis(axis).duration(), motion.duration());
            longest = std::max(longest, motion.axis(axis).feasible(0.0));
            const Motion error = motion.axis(axis).roundingError();
            ASSERT_LE(std::abs(error.position),
                      1e-10 * tasks[axis].limits.velocity * motion.duration());
        }
        ASSERT_GE(motion.duration(), longest);
    }
}

TEST(SynchronizedMotion, ReachesTheTargetInAnyFeasibleDuration) {
    RandomTasks random(4);
    for (int i = 0; i < kTasks; ++i) {
        const AxisTask task = random.moving();
        const double shortest = durationOf(task);
        const SynchronizedMotion motion = planned({task}, shortest * random.between(1.0, 4.0));
        ASSERT_NO_FATAL_FAILURE(
            expectSmooth(motion, 0, task, task.limits.velocity, task.limits.acceleration))
            << i;
    }
}

TEST(SynchronizedMotion, SkipsDurationsInWhichAnAxisWouldPassItsTarget) {
    // The axis is at its target, and as fast. Later it must turn back and speed up again: a change
    // of its velocity by 2 and back takes 6 s, in which it comes 0 m far.
    const AxisTask passing{{0.0, 1.0, 0.0}, {0.0, 1.0}, {1.0, 1.0, 1.0}};
    EXPECT_EQ(durationOf(passing), 0.0);
    EXPECT_NEAR(planned({passing}, 0.1).duration(), 6.0, 1e-12);
    EXPECT_EQ(planned({passing}, 6.5).duration(), 6.5);
    const AxisTask other{{0.0, 0.0, 0.0}, {1.0, 0.0}, {1.0, 1.0, 1.0}};
    const SynchronizedMotion both = planned({other, passing});
    EXPECT_NEAR(both.duration(), 6.0, 1e-12);
    EXPECT_NO_FATAL_FAILURE(expectSmooth(both, 0, other, 1.0, 1.0));
    EXPECT_NO_FATAL_FAILURE(expectSmooth(both, 1, passing, 1.0, 1.0));
}

TEST(SynchronizedMotion, KeepsTheArrivalTimeWhenPlannedAgainWhileMoving) {
    RandomTasks random(5);
    for (int i = 0; i < kTasks / 10; ++i) {
        AxisTask task = random.moving();
        SynchronizedMotion motion = planned({task});
        const double arrival = motion.duration();
        const int steps = 40;
        for (int step = 1; step < steps; ++step) {
            task.begin = motion.at(0, arrival / steps);
            motion = planned({task});
            ASSERT_NEAR(motion.duration(), arrival * (steps - step) / steps, 1e-5 * arrival)
                << i << " " << step;
        }
    }
}

TEST(SynchronizedMotion, IsTheSameInOtherUnits) {
    RandomTasks random(6);
    for (int i = 0; i < kTasks; ++i) {
        AxisTask task = random.any();
        const double duration = durationOf(task);
        const double scale = std::pow(10.0, random.between(-6.0, 4.0));
        for (double* value : {&task.begin.position, &task.begin.velocity, &task.begin.acceleration,
                              &task.target.position, &task.target.velocity, &task.limits.velocity,
                              &task.limits.acceleration, &task.limits.jerk})
            *value *= scale;
        ASSERT_NEAR(durationOf(task), duration, 1e-9 * duration) << i;
    }
}

TEST(SynchronizedMotion, MovesLittleFarFromZero) {
    const AxisTask task{{1e4, 0.0, 0.0}, {1e4 + 1e-6, 0.0}, {1.0, 1.0, 1.0}};
    const SynchronizedMotion motion = planned({task});
    EXPECT_NEAR(motion.duration(), std::cbrt(32e-6), 1e-5 * std::cbrt(32e-6));
    EXPECT_NO_FATAL_FAILURE(expectSmooth(motion, 0, task, 1.0, 1.0));
}

TEST(SynchronizedMotion, IsBitIdenticalTwice) {
    RandomTasks random(7);
    for (int i = 0; i < kTasks / 10; ++i) {
        std::vector<AxisTask> tasks(3);
        for (AxisTask& task : tasks) task = random.any();
        const SynchronizedMotion one = planned(tasks);
        SynchronizedMotion other = planned({random.any()});
        EXPECT_EQ(other.plan(tasks.data(), tasks.size()), PlanError::None);
        for (int k = 0; k <= kSamples; ++k) {
            for (std::size_t axis = 0; axis < tasks.size(); ++axis) {
                const Motion a = one.at(axis, k * one.duration() / kSamples);
                const Motion b = other.at(axis, k * one.duration() / kSamples);
                ASSERT_EQ(bitsOf(a.position), bitsOf(b.position)) << i;
                ASSERT_EQ(bitsOf(a.velocity), bitsOf(b.velocity)) << i;
                ASSERT_EQ(bitsOf(a.acceleration), bitsOf(b.acceleration)) << i;
            }
        }
    }
}

TEST(SynchronizedMotion, MovesOnAtTheTargetsVelocity) {
    const AxisTask task{{0.0, 0.0, 0.0}, {1.0, 0.5}, {1.0, 1.0, 1.0}};
    const SynchronizedMotion motion = planned({task});
    const Motion after = motion.at(0, motion.duration() + 2.0);
    EXPECT_DOUBLE_EQ(after.position, 2.0);
    EXPECT_EQ(after.velocity, 0.5);
    EXPECT_EQ(after.acceleration, 0.0);
}

TEST(SynchronizedMotion, KeepsTheMotionAfterAnError) {
    const AxisTask task{{0.0, 0.0, 0.0}, {1.0, 0.0}, {1.0, 1.0, 1.0}};
    SynchronizedMotion motion = planned({task});
    const double duration = motion.duration();

    const auto expectError = [&](PlanError error, const std::vector<AxisTask>& tasks) {
        EXPECT_EQ(motion.plan(tasks.data(), tasks.size()), error);
        EXPECT_EQ(motion.duration(), duration);
        EXPECT_EQ(motion.at(0, duration).position, 1.0);
    };
    expectError(PlanError::AxisCount, {});
    expectError(PlanError::AxisCount,
                std::vector<AxisTask>(SynchronizedMotion::kMostAxes + 1, task));
    AxisTask wrong = task;
    wrong.begin.velocity = std::numeric_limits<double>::quiet_NaN();
    expectError(PlanError::NotFinite, {task, wrong});
    wrong = task;
    wrong.limits.jerk = 0.0;
    expectError(PlanError::Limits, {wrong});
    wrong.limits.jerk = -1.0;
    expectError(PlanError::Limits, {wrong});
    wrong = task;
    wrong.target.velocity = -1.1;
    expectError(PlanError::TargetVelocity, {wrong});
    wrong = task;
    wrong.target.position = 1e300;
    wrong.limits.velocity = 1e-300;
    expectError(PlanError::Range, {wrong});
}

TEST(SynchronizedMotion, KnowsTheRangeOfItsPositions) {
    RandomTasks tasks(33);
    for (int n = 0; n < kTasks; ++n) {
        const AxisTask task = tasks.any();
        const SynchronizedMotion motion = planned({task});
        const PositionRange range = motion.axis(0).range();
        const double h = motion.duration() / kSamples;
        const double largest =
            std::max(task.limits.acceleration, std::abs(task.begin.acceleration));
        const double size =
            std::abs(task.begin.position) + std::abs(task.target.position) +
            (std::abs(task.begin.velocity) + task.limits.velocity) * motion.duration();
        double lowest = task.begin.position;
        double highest = lowest;
        for (int i = 0; i <= kSamples; ++i) {
            lowest = std::min(lowest, motion.at(0, i * h).position);
            highest = std::max(highest, motion.at(0, i * h).position);
        }
        ASSERT_GE(lowest, range.lower - 1e-9 * size);
        ASSERT_LE(highest, range.upper + 1e-9 * size);
        ASSERT_NEAR(lowest, range.lower, largest * h * h + 1e-9 * size);
        ASSERT_NEAR(highest, range.upper, largest * h * h + 1e-9 * size);
    }
}

}  // namespace
}  // namespace rtcf::test
