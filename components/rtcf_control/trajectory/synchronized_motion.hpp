/// @file
/// Motions of several axes that start and end together.
#pragma once

#include <array>
#include <cstddef>

#include "trajectory/axis_motion.hpp"
#include "trajectory/motion.hpp"

namespace rtcf_control {

/// One axis of a SynchronizedMotion.
struct AxisTask {
    Motion begin;
    MotionTarget target;
    MotionLimits limits;
};

/// Why a motion cannot be planned.
enum class PlanError {
    None,
    AxisCount,       ///< no axis, or more than kMostAxes
    NotFinite,       ///< a number is infinite or NaN
    Limits,          ///< a limit is zero or negative
    TargetVelocity,  ///< the velocity at the target is beyond the limit
    Range,           ///< the duration is beyond the range of numbers
};

/// Jerk-limited motions of up to 16 axes from any states to targets, which all begin and end at the
/// same times, as early as possible. To plan again while moving, begin at the states that at()
/// gives for the present time, not at measured ones: an axis that is to pass its target at a
/// velocity, and that a measurement shows slightly late or early, may have to return for it.
///
/// All functions are real-time safe, with a bounded number of steps. The object has no pointers
/// and may be copied as bytes.
class SynchronizedMotion {
   public:
    static constexpr std::size_t kMostAxes = 16;

    /// Plans the motions. They stay as they are after an error.
    /// @param tasks one per axis
    /// @param least_duration the motions last at least as long, s
    PlanError plan(const AxisTask* tasks, std::size_t count, double least_duration = 0.0) noexcept
        RTCF_NONBLOCKING;

    [[nodiscard]] std::size_t size() const noexcept RTCF_NONBLOCKING { return count_; }
    /// Duration of all motions, s.
    [[nodiscard]] double duration() const noexcept RTCF_NONBLOCKING { return duration_; }
    /// The motion of an axis at some time after the start, s. After the end, the axis moves on at
    /// the velocity of its target.
    [[nodiscard]] Motion at(std::size_t axis, double time) const noexcept RTCF_NONBLOCKING {
        return axes_[axis].at(time);
    }
    /// The planned motion of an axis.
    [[nodiscard]] const AxisMotion& axis(std::size_t axis) const noexcept RTCF_NONBLOCKING {
        return axes_[axis];
    }

   private:
    std::array<AxisMotion, kMostAxes> axes_{};
    std::size_t count_ = 0;
    double duration_ = 0.0;
};

}  // namespace rtcf_control
