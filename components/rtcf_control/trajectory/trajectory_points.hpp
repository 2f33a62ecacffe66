/// @file
/// The points of a joint trajectory, and the motion through them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "trajectory/motion.hpp"
#include "trajectory/polynomial_segment.hpp"

namespace rtcf_control {

/// A list of points in the order of their times, with a PolynomialSegment from each to the next
/// one. Points are removed at the front as time passes, and at the back when a new trajectory
/// replaces the tail. Times are in ns, of any clock.
///
/// All functions but the constructor are real-time safe. Only one thread uses the object.
class TrajectoryPoints {
   public:
    static constexpr std::size_t kCapacity = 1024;

    /// Allocates the memory of kCapacity points. Not real-time.
    explicit TrajectoryPoints(std::size_t joints);

    [[nodiscard]] std::size_t size() const noexcept RTCF_NONBLOCKING { return count_; }
    [[nodiscard]] bool empty() const noexcept RTCF_NONBLOCKING { return count_ == 0; }
    /// Time of the first point, ns. The list is not empty.
    [[nodiscard]] std::int64_t begin() const noexcept RTCF_NONBLOCKING { return time(0); }
    /// Time of the last point, ns. The list is not empty.
    [[nodiscard]] std::int64_t end() const noexcept RTCF_NONBLOCKING { return time(count_ - 1); }
    void clear() noexcept RTCF_NONBLOCKING { count_ = 0; }
    /// Removes points that at() does not need for `time` and later times.
    void forgetBefore(std::int64_t time) noexcept RTCF_NONBLOCKING;
    /// Number of points before a time.
    [[nodiscard]] std::size_t countBefore(std::int64_t time) const noexcept RTCF_NONBLOCKING;
    /// Removes the points at and after a time.
    void truncate(std::int64_t time) noexcept RTCF_NONBLOCKING { count_ = countBefore(time); }

    /// Appends a point after end(). At most kCapacity points.
    /// @param kind of the segment that ends at the point
    /// @return the motions of all joints at the point, which the caller sets. at() ignores values
    ///         that neither of the adjacent segments uses; last() returns all values of the last
    ///         point.
    Motion* append(std::int64_t time, PointKind kind) noexcept RTCF_NONBLOCKING;
    /// The kind of the segment that contains a time.
    [[nodiscard]] PointKind kindAt(std::int64_t time) const noexcept RTCF_NONBLOCKING;
    /// Time of a point, ns, the kind of the segment that ends there, and the motions of all joints.
    /// @param index below size()
    [[nodiscard]] std::int64_t time(std::size_t index) const noexcept RTCF_NONBLOCKING {
        return heads_[slot(index)].time;
    }
    [[nodiscard]] PointKind kind(std::size_t index) const noexcept RTCF_NONBLOCKING {
        return heads_[slot(index)].kind;
    }
    [[nodiscard]] const Motion* motions(std::size_t index) const noexcept RTCF_NONBLOCKING {
        return &motions_[slot(index) * joints_];
    }
    /// The motion of a joint from begin() to end(). The list is not empty.
    [[nodiscard]] Motion at(std::size_t joint, std::int64_t time) const noexcept RTCF_NONBLOCKING;
    /// The motion of a joint at the last point. The list is not empty.
    [[nodiscard]] const Motion& last(std::size_t joint) const noexcept RTCF_NONBLOCKING {
        return motions(count_ - 1)[joint];
    }

   private:
    struct Head {
        std::int64_t time = 0;
        PointKind kind = PointKind::Position;
    };

    // Points are kept in a ring.
    [[nodiscard]] std::size_t slot(std::size_t index) const noexcept {
        return (first_ + index) % kCapacity;
    }
    // The index of the point at which the segment that contains a time ends.
    [[nodiscard]] std::size_t segmentEnd(std::int64_t time) const noexcept;

    std::size_t joints_;
    std::size_t first_ = 0;
    std::size_t count_ = 0;
    std::vector<Head> heads_;
    std::vector<Motion> motions_;
};

}  // namespace rtcf_control
