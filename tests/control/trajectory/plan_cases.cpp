// Plans synchronised motions that it reads from standard input, samples them finely, and prints
// durations, errors and motions for compare_with_ruckig.py.
//
// A line of input is a case:
//     axes fraction {position velocity acceleration  position velocity  velocity acceleration jerk}
// with start, target and limits of each axis. A line of output is
//     error duration excess gap rounding {shortest  position velocity acceleration}
// with the PlanError, the duration in s, and, relative to limits and sizes of the motion,
//     excess    velocity or acceleration beyond the limits, and beyond the excess that the start
//               makes unavoidable
//     gap       steps of position, velocity and acceleration between two samples, beyond those of
//               the largest jerk
//     rounding  the distance between the end of the last phase and the target
// and, for each axis, its own shortest duration and its motion at the fraction of the duration.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <limits>

#include "trajectory/synchronized_motion.hpp"

namespace {

using rtcf_control::AxisTask;
using rtcf_control::Motion;
using rtcf_control::PlanError;
using rtcf_control::SynchronizedMotion;

struct Findings {
    double excess = 0.0;
    double gap = 0.0;
    double rounding = 0.0;

    void add(double& worst, double value) const {
        worst =
            std::isfinite(value) ? std::max(worst, value) : std::numeric_limits<double>::infinity();
    }
};

constexpr int kSamples = 400;

// The largest velocity that a motion may have in the positive direction: the limit, or the velocity
// at the start, or the velocity when the acceleration at the start has been reduced to 0.
double unavoidable(const Motion& begin, const AxisTask& task) {
    return std::max({task.limits.velocity, begin.velocity, begin.easedVelocity(task.limits.jerk)});
}

void sample(const SynchronizedMotion& motion, std::size_t axis, const AxisTask& task,
            Findings& findings) {
    const rtcf_control::MotionLimits& limits = task.limits;
    const double up = unavoidable(task.begin, task);
    const double down = unavoidable(task.begin.mirrored(), task);
    const double acceleration = std::max(limits.acceleration, std::abs(task.begin.acceleration));
    const double h = motion.duration() / kSamples;
    const double size =
        std::max({std::abs(task.begin.position), std::abs(task.target.position),
                  std::max(up, down) * motion.duration(), std::numeric_limits<double>::min()});
    const double speed = std::max(up, down);
    Motion last = motion.at(axis, 0.0);
    for (int i = 0; i <= kSamples; ++i) {
        const Motion now =
            i == kSamples ? motion.at(axis, motion.duration()) : motion.at(axis, i * h);
        findings.add(findings.excess, (now.velocity - up) / limits.velocity);
        findings.add(findings.excess, (-now.velocity - down) / limits.velocity);
        findings.add(findings.excess,
                     (std::abs(now.acceleration) - acceleration) / limits.acceleration);
        if (i > 0) {
            const double v = now.velocity - last.velocity - h * last.acceleration;
            const double p =
                now.position - last.position - h * (last.velocity + h * last.acceleration / 2.0);
            findings.add(
                findings.gap,
                (std::abs(now.acceleration - last.acceleration) - limits.jerk * h) / acceleration);
            findings.add(findings.gap, (std::abs(v) - limits.jerk * h * h / 2.0) / speed);
            findings.add(findings.gap, (std::abs(p) - limits.jerk * h * h * h / 6.0) / size);
        }
        last = now;
    }
    const Motion error = motion.axis(axis).roundingError();
    findings.add(findings.rounding, std::abs(error.position) / size);
    findings.add(findings.rounding, std::abs(error.velocity) / speed);
    findings.add(findings.rounding, std::abs(error.acceleration) / acceleration);
}

}  // namespace

int main() {
    std::size_t axes = 0;
    double fraction = 0.0;
    std::array<AxisTask, SynchronizedMotion::kMostAxes> tasks;
    while (std::cin >> axes >> fraction && axes <= tasks.size()) {
        for (std::size_t i = 0; i < axes; ++i) {
            AxisTask& task = tasks[i];
            std::cin >> task.begin.position >> task.begin.velocity >> task.begin.acceleration >>
                task.target.position >> task.target.velocity >> task.limits.velocity >>
                task.limits.acceleration >> task.limits.jerk;
        }
        SynchronizedMotion motion;
        const PlanError error = motion.plan(tasks.data(), axes);
        Findings findings;
        if (error == PlanError::None) {
            for (std::size_t i = 0; i < axes; ++i) sample(motion, i, tasks[i], findings);
        }
        std::printf("%d %.17g %.3g %.3g %.3g", static_cast<int>(error), motion.duration(),
                    findings.excess, findings.gap, findings.rounding);
        for (std::size_t i = 0; i < axes && error == PlanError::None; ++i) {
            const Motion at = motion.at(i, fraction * motion.duration());
            std::printf(" %.17g %.17g %.17g %.17g", motion.axis(i).feasible(0.0), at.position,
                        at.velocity, at.acceleration);
        }
        std::printf("\n");
    }
    return 0;
}
