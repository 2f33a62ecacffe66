#include "trajectory/synchronized_motion.hpp"

#include <algorithm>
#include <cmath>
#include <type_traits>

namespace rtcf_control {

static_assert(std::is_trivially_copyable_v<SynchronizedMotion>);

namespace {

// A velocity at the target that exceeds the limit by less than this part of it is a rounding error.
constexpr double kTargetTolerance = 1e-12;

PlanError errorOf(const AxisTask& task) noexcept {
    for (const double value :
         {task.begin.position, task.begin.velocity, task.begin.acceleration, task.target.position,
          task.target.velocity, task.limits.velocity, task.limits.acceleration, task.limits.jerk}) {
        if (!std::isfinite(value)) return PlanError::NotFinite;
    }
    for (const double value : {task.limits.velocity, task.limits.acceleration, task.limits.jerk}) {
        if (!(value > 0.0)) return PlanError::Limits;
    }
    if (std::abs(task.target.velocity) > task.limits.velocity * (1.0 + kTargetTolerance))
        return PlanError::TargetVelocity;
    return PlanError::None;
}

}  // namespace

PlanError SynchronizedMotion::plan(const AxisTask* tasks, std::size_t count,
                                   double least_duration) noexcept RTCF_NONBLOCKING {
    if (count == 0 || count > kMostAxes) return PlanError::AxisCount;
    if (!std::isfinite(least_duration)) return PlanError::NotFinite;
    for (std::size_t i = 0; i < count; ++i) {
        if (const PlanError error = errorOf(tasks[i]); error != PlanError::None) return error;
    }
    std::array<AxisMotion, kMostAxes> axes;
    for (std::size_t i = 0; i < count; ++i)
        axes[i].prepare(tasks[i].begin, tasks[i].target, tasks[i].limits);

    // The least duration that is feasible for all axes. Each change leaves an interval for good.
    double duration = std::max(least_duration, 0.0);
    bool changed = true;
    while (changed) {
        changed = false;
        for (std::size_t i = 0; i < count; ++i) {
            const double feasible = axes[i].feasible(duration);
            changed = changed || feasible > duration;
            duration = std::max(duration, feasible);
        }
    }
    if (!std::isfinite(duration)) return PlanError::Range;
    for (std::size_t i = 0; i < count; ++i) {
        axes[i].plan(duration);
        if (!std::isfinite(axes[i].roundingError().position)) return PlanError::Range;
    }
    std::copy_n(axes.begin(), count, axes_.begin());
    count_ = count;
    duration_ = duration;
    return PlanError::None;
}

}  // namespace rtcf_control
