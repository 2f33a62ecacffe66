/// @file
/// The motion of one axis from any state to a target, in any duration in which it can be done.
#pragma once

#include <array>
#include <cstddef>

#include "trajectory/farthest_motion.hpp"
#include "trajectory/motion.hpp"

namespace rtcf_control {

/// A motion of one axis from a state to a target, within limits of velocity, acceleration and jerk,
/// as phases of constant jerk.
///
/// A state beyond the limits is brought back first, as fast as possible. After that, the positions
/// that the axis can reach in a given duration are all positions from that of the FarthestMotion
/// backward to that of the FarthestMotion forward: the system is linear and the limits are convex,
/// so a weighted mean of two motions is a motion. A duration is feasible if the target is among
/// these positions. As the velocity at the target may be other than zero, there may be up to two
/// blocked intervals of duration between feasible ones: while waiting, the axis moves past the
/// target.
///
/// Of the motions of a given duration, the axis takes one that changes to some velocity, keeps it,
/// and changes to that of the target. If there is none, it takes the weighted mean of the farthest
/// motions.
///
/// All functions are real-time safe, with a bounded number of steps. The object has no pointers
/// and may be copied as bytes.
class AxisMotion {
   public:
    /// Finds the feasible durations. plan() has to follow.
    /// @param begin  finite
    /// @param target finite; its velocity is within the limits
    /// @param limits finite, above zero
    void prepare(const Motion& begin, const MotionTarget& target,
                 const MotionLimits& limits) noexcept RTCF_NONBLOCKING;
    /// The least feasible duration that is not below a given one, s.
    [[nodiscard]] double feasible(double duration) const noexcept RTCF_NONBLOCKING;
    /// Plans the motion of a feasible duration, s. After prepare().
    void plan(double duration) noexcept RTCF_NONBLOCKING;

    /// Duration of the planned motion, s.
    [[nodiscard]] double duration() const noexcept RTCF_NONBLOCKING { return duration_; }
    /// The motion at some time after the start, s. After the end, the axis moves on at the velocity
    /// of the target.
    [[nodiscard]] Motion at(double time) const noexcept RTCF_NONBLOCKING;
    /// The positions that the planned motion passes up to its end.
    [[nodiscard]] PositionRange range() const noexcept RTCF_NONBLOCKING;
    /// The difference between the target and the end of the last phase, due to rounding.
    [[nodiscard]] Motion roundingError() const noexcept RTCF_NONBLOCKING;

   private:
    // Durations from `above` to `below`, both excluded, in which the target cannot be reached.
    struct Blocked {
        double above;
        double below;
    };
    struct Piece {
        double begin;  // s
        double jerk;
        Motion motion;  // at its start; the position is relative to that of the whole motion
    };
    using Phases = PhaseList<14>;

    void block(double above, double below) noexcept;
    // Adds the intervals in which the farthest motion does not get as far as a distance.
    void blockShort(const FarthestMotion& farthest, double distance) noexcept;
    [[nodiscard]] double solve(const FarthestMotion& farthest, double distance, double low,
                               double high) const noexcept;
    // The phases after the return to the limits, of a duration.
    [[nodiscard]] Phases phases(double duration) const noexcept;
    // Finds phases that change to a velocity, keep it, and change to that of the target.
    [[nodiscard]] bool cruise(double duration, Phases& phases) const noexcept;
    // The weighted mean of the farthest motions.
    [[nodiscard]] Phases mean(double duration, double weight) const noexcept;

    Motion begin_;
    MotionTarget target_;
    MotionLimits limits_;
    PhaseList<2> return_;  // from beyond the limits
    Motion returned_;      // the motion after that; its position is relative to begin_
    double return_duration_ = 0.0;
    double distance_ = 0.0;   // from returned_ to the target
    double tolerance_ = 0.0;  // rounding errors of distances
    // If the fastest change to the target's velocity ends nearer to the target than this, it ends
    // at the target: the axis follows an earlier plan, with rounding errors.
    double arrival_tolerance_ = 0.0;
    FarthestMotion forward_;
    FarthestMotion backward_;  // mirrored
    std::array<Blocked, 5> blocked_{};
    std::size_t blocked_count_ = 0;

    std::array<Piece, 17> pieces_{};
    std::size_t piece_count_ = 0;
    Motion end_;  // after all pieces
    double duration_ = 0.0;
};

}  // namespace rtcf_control
