/// @file
/// The motion of one axis at one time, its limits, and phases of constant jerk. Positions have any
/// unit (m, rad), written "unit" in comments; times are in s.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include <rtcf/realtime.hpp>

namespace rtcf_control {

/// Position, velocity and acceleration of one axis.
struct Motion {
    double position = 0.0;      ///< unit
    double velocity = 0.0;      ///< unit/s
    double acceleration = 0.0;  ///< unit/s²

    /// The motion after some time of constant jerk. Real-time safe.
    /// @param duration s
    /// @param jerk     unit/s³
    [[nodiscard]] Motion after(double duration, double jerk) const noexcept RTCF_NONBLOCKING {
        const double t = duration;
        return {position + t * (velocity + t * (acceleration / 2.0 + t * jerk / 6.0)),
                velocity + t * (acceleration + t * jerk / 2.0), acceleration + t * jerk};
    }

    /// The same motion in the opposite direction. Real-time safe.
    [[nodiscard]] Motion mirrored() const noexcept RTCF_NONBLOCKING {
        return {-position, -velocity, -acceleration};
    }

    /// The velocity after the acceleration was brought to zero as fast as possible, unit/s.
    /// Real-time safe.
    /// @param jerk largest jerk, unit/s³
    [[nodiscard]] double easedVelocity(double jerk) const noexcept RTCF_NONBLOCKING {
        const double magnitude = acceleration < 0.0 ? -acceleration : acceleration;
        return velocity + acceleration * magnitude / (2.0 * jerk);
    }
};

/// The positions that a motion passes, or may pass.
struct PositionRange {
    double lower = 0.0;  ///< unit
    double upper = 0.0;  ///< unit

    /// All positions.
    static constexpr PositionRange unlimited() noexcept {
        return {-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
    }

    /// Adds a position. Real-time safe.
    void add(double position) noexcept RTCF_NONBLOCKING {
        lower = std::min(lower, position);
        upper = std::max(upper, position);
    }
    /// Adds the positions of a time of constant jerk: those at both ends, and those at which the
    /// velocity changes its sign. Real-time safe.
    /// @param duration s
    /// @param jerk     unit/s³
    void add(const Motion& begin, double duration, double jerk) noexcept RTCF_NONBLOCKING {
        add(begin.position);
        add(begin.after(duration, jerk).position);
        const double square = begin.acceleration * begin.acceleration - 2.0 * jerk * begin.velocity;
        if (!(square >= 0.0)) return;
        // The roots of velocity + acceleration t + jerk t² / 2, without cancellation.
        const double sum =
            -(begin.acceleration + std::copysign(std::sqrt(square), begin.acceleration));
        for (const double time : {sum / jerk, 2.0 * begin.velocity / sum}) {
            // Not for NaN, of zero by zero.
            if (time > 0.0 && time < duration) add(begin.after(time, jerk).position);
        }
    }
};

/// Position and velocity at which a motion ends. Its acceleration there is zero.
struct MotionTarget {
    double position = 0.0;  ///< unit
    double velocity = 0.0;  ///< unit/s
};

/// Largest magnitudes of one axis, in both directions. All are above zero.
struct MotionLimits {
    double velocity = 1.0;      ///< unit/s
    double acceleration = 1.0;  ///< unit/s²
    double jerk = 1.0;          ///< unit/s³
};

/// The motion with the acceleration nearest to its own that is within the limits, and from which
/// the velocity stays within its limit if the jerk does; a velocity beyond its limit does not grow.
/// An acceleration that is within already, except for rounding errors, does not change. Real-time
/// safe.
[[nodiscard]] inline Motion withAllowedAcceleration(Motion motion,
                                                    const MotionLimits& limits) noexcept
    RTCF_NONBLOCKING {
    constexpr double kTolerance = 1.0 + 1e-9;
    double& a = motion.acceleration;
    const double speed_then = std::copysign(1.0, a) * motion.easedVelocity(limits.jerk);
    if (std::abs(a) <= limits.acceleration * kTolerance &&
        (a == 0.0 || speed_then <= limits.velocity * kTolerance))
        return motion;
    // The velocity rises by a² / (2 jerk) while the acceleration is brought to zero.
    const double room = limits.velocity - std::copysign(1.0, a) * motion.velocity;
    const double largest =
        std::min(limits.acceleration, std::sqrt(2.0 * limits.jerk * std::max(room, 0.0)));
    a = std::clamp(a, -largest, largest);
    return motion;
}

/// A time of constant jerk.
struct Phase {
    double duration = 0.0;  ///< s
    double jerk = 0.0;      ///< unit/s³
    /// The acceleration at the end, unit/s². Its rounding error would grow in a long phase of
    /// constant velocity.
    double acceleration = 0.0;

    /// The motion after the phase. Real-time safe.
    [[nodiscard]] Motion after(const Motion& begin) const noexcept RTCF_NONBLOCKING {
        Motion motion = begin.after(duration, jerk);
        motion.acceleration = acceleration;
        return motion;
    }
};

/// A list of phases, without memory of its own.
/// @tparam kMost largest number of phases
template <std::size_t kMost>
class PhaseList {
   public:
    /// Appends a phase. Phases that do not last are left out. Real-time safe.
    void add(const Phase& phase) noexcept RTCF_NONBLOCKING {
        if (phase.duration > 0.0 && count_ < kMost) phases_[count_++] = phase;
    }
    /// Appends all phases of a list. Real-time safe.
    template <std::size_t kOther>
    void add(const PhaseList<kOther>& list) noexcept RTCF_NONBLOCKING {
        for (const Phase& phase : list) add(phase);
    }
    /// Turns the motion into the opposite direction. Real-time safe.
    void mirror() noexcept RTCF_NONBLOCKING {
        for (std::size_t i = 0; i < count_; ++i) {
            phases_[i].jerk = -phases_[i].jerk;
            phases_[i].acceleration = -phases_[i].acceleration;
        }
    }
    /// The motion after all phases. Real-time safe.
    [[nodiscard]] Motion motionAfter(Motion motion) const noexcept RTCF_NONBLOCKING {
        for (const Phase& phase : *this) motion = phase.after(motion);
        return motion;
    }
    /// Sum of the durations, s. Real-time safe.
    [[nodiscard]] double duration() const noexcept RTCF_NONBLOCKING {
        double sum = 0.0;
        for (const Phase& phase : *this) sum += phase.duration;
        return sum;
    }
    [[nodiscard]] std::size_t size() const noexcept RTCF_NONBLOCKING { return count_; }
    [[nodiscard]] const Phase* begin() const noexcept RTCF_NONBLOCKING { return phases_.data(); }
    [[nodiscard]] const Phase* end() const noexcept RTCF_NONBLOCKING {
        return phases_.data() + count_;
    }

   private:
    std::array<Phase, kMost> phases_{};
    std::size_t count_ = 0;
};

}  // namespace rtcf_control
