#include "trajectory/trajectory_points.hpp"

#include <algorithm>

namespace rtcf_control {

TrajectoryPoints::TrajectoryPoints(std::size_t joints)
    : joints_(joints), heads_(kCapacity), motions_(kCapacity * joints) {}

std::size_t TrajectoryPoints::countBefore(std::int64_t time) const noexcept RTCF_NONBLOCKING {
    std::size_t low = 0;
    std::size_t high = count_;
    while (low < high) {
        const std::size_t middle = (low + high) / 2;
        if (this->time(middle) < time) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

std::size_t TrajectoryPoints::segmentEnd(std::int64_t time) const noexcept {
    return std::clamp<std::size_t>(countBefore(time), 1, count_ - 1);
}

void TrajectoryPoints::forgetBefore(std::int64_t time) noexcept RTCF_NONBLOCKING {
    if (count_ < 2) return;
    const std::size_t past = segmentEnd(time) - 1;
    first_ = slot(past);
    count_ -= past;
}

Motion* TrajectoryPoints::append(std::int64_t time, PointKind kind) noexcept RTCF_NONBLOCKING {
    const std::size_t at = slot(std::min(count_, kCapacity - 1));
    count_ = std::min(count_ + 1, kCapacity);
    heads_[at] = {time, kind};
    return &motions_[at * joints_];
}

PointKind TrajectoryPoints::kindAt(std::int64_t time) const noexcept RTCF_NONBLOCKING {
    return heads_[slot(count_ < 2 ? 0 : segmentEnd(time))].kind;
}

Motion TrajectoryPoints::at(std::size_t joint, std::int64_t time) const noexcept RTCF_NONBLOCKING {
    if (count_ < 2) return motions(0)[joint];
    const std::size_t end = segmentEnd(time);
    const std::int64_t begin_time = this->time(end - 1);
    const auto seconds = [](std::int64_t ns) { return 1e-9 * static_cast<double>(ns); };
    const PolynomialSegment segment(motions(end - 1)[joint], motions(end)[joint],
                                    heads_[slot(end)].kind, seconds(this->time(end) - begin_time));
    return segment.at(seconds(time - begin_time));
}

}  // namespace rtcf_control
