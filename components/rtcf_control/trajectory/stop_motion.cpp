#include "trajectory/stop_motion.hpp"

#include <cmath>

#include "trajectory/velocity_change.hpp"

namespace rtcf_control {

StopMotion::StopMotion(const Motion& begin, const MotionLimits& limits) noexcept RTCF_NONBLOCKING
    : begin_(begin) {
    const double over = std::abs(begin.acceleration) - limits.acceleration;
    if (over > 0.0) {
        phases_.add({over / limits.jerk, -std::copysign(limits.jerk, begin.acceleration),
                     std::copysign(limits.acceleration, begin.acceleration)});
    }
    const Motion within = phases_.motionAfter(begin);
    phases_.add(VelocityChange(within, 0.0, limits).phases());
    duration_ = phases_.duration();
    end_ = phases_.motionAfter(begin).position;
}

Motion StopMotion::at(double time) const noexcept RTCF_NONBLOCKING {
    if (!(time < duration_)) return {end_, 0.0, 0.0};
    Motion motion = begin_;
    if (!(time > 0.0)) return motion;
    for (const Phase& phase : phases_) {
        if (time < phase.duration) return motion.after(time, phase.jerk);
        motion = phase.after(motion);
        time -= phase.duration;
    }
    return {end_, 0.0, 0.0};
}

PositionRange StopMotion::range() const noexcept RTCF_NONBLOCKING {
    PositionRange range{begin_.position, begin_.position};
    Motion motion = begin_;
    for (const Phase& phase : phases_) {
        range.add(motion, phase.duration, phase.jerk);
        motion = phase.after(motion);
    }
    return range;
}

}  // namespace rtcf_control
