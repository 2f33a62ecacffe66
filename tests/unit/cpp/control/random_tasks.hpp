// Random tasks for tests of trajectories.
#pragma once

#include <cmath>
#include <random>

#include "trajectory/synchronized_motion.hpp"

namespace rtcf::test {

#ifdef RTCF_SANITIZED
constexpr int kTasks = 300;
#else
constexpr int kTasks = 3000;
#endif

/// Draws the same tasks each time.
class RandomTasks {
   public:
    explicit RandomTasks(unsigned seed) : random_(seed) {}

    double between(double low, double high) {
        return std::uniform_real_distribution<double>(low, high)(random_);
    }
    bool chance(double probability) { return between(0.0, 1.0) < probability; }

    /// From rest to rest.
    rtcf_control::AxisTask resting() {
        rtcf_control::AxisTask task;
        task.limits = {std::pow(10.0, between(-1.0, 1.0)), std::pow(10.0, between(-1.0, 1.0)),
                       std::pow(10.0, between(-1.0, 1.0))};
        task.begin.position = between(-1.0, 1.0);
        draw(task.target, task);
        task.target.velocity = 0.0;
        return task;
    }
    /// Begins in motion, at a state from which the axis can stay within its limits; half of the
    /// targets move.
    rtcf_control::AxisTask moving() {
        rtcf_control::AxisTask task = resting();
        const rtcf_control::MotionLimits& limits = task.limits;
        do {
            task.begin.velocity = between(-1.0, 1.0) * limits.velocity;
            task.begin.acceleration = between(-1.0, 1.0) * limits.acceleration;
        } while (std::abs(task.begin.easedVelocity(limits.jerk)) > limits.velocity);
        draw(task.target, task);
        return task;
    }
    /// Begins beyond the limits.
    rtcf_control::AxisTask excessive() {
        rtcf_control::AxisTask task = moving();
        task.begin.velocity = between(-2.0, 2.0) * task.limits.velocity;
        task.begin.acceleration = between(-2.0, 2.0) * task.limits.acceleration;
        return task;
    }
    /// Any of these.
    rtcf_control::AxisTask any() {
        const double kind = between(0.0, 3.0);
        if (kind < 1.0) return resting();
        return kind < 2.0 ? moving() : excessive();
    }
    /// Another target for a task.
    void draw(rtcf_control::MotionTarget& target, const rtcf_control::AxisTask& task) {
        const rtcf_control::MotionLimits& limits = task.limits;
        const double reach = limits.velocity * (limits.velocity / limits.acceleration +
                                                limits.acceleration / limits.jerk);
        target.position = task.begin.position + std::copysign(1.0, between(-1.0, 1.0)) * reach *
                                                    std::pow(10.0, between(-3.0, 1.0));
        target.velocity = chance(0.5) ? between(-1.0, 1.0) * limits.velocity : 0.0;
    }

   private:
    std::mt19937_64 random_;
};

}  // namespace rtcf::test
