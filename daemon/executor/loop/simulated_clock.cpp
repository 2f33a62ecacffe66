#include "loop/simulated_clock.hpp"

namespace rtcf::executor {

void SimulatedClock::tick(std::int64_t now_ns) {
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (ticks_.size() < kMaxTicks) {
            ticks_.push_back(now_ns);
        } else {
            ticks_.back() = now_ns;
        }
    }
    ticked_.notify_one();
}

void SimulatedClock::reset(std::int64_t max_jump_ns) {
    const std::lock_guard<std::mutex> lock(mutex_);
    ticks_.clear();
    tick_.reset();
    jumps_.clear();
    max_jump_ns_ = max_jump_ns;
}

std::optional<std::int64_t> SimulatedClock::next(std::int64_t period_ns,
                                                 std::chrono::milliseconds patience) {
    const auto until = std::chrono::steady_clock::now() + patience;
    std::unique_lock<std::mutex> lock(mutex_);
    while (true) {
        if (tick_ && *tick_ - cycle_ns_ >= period_ns) return cycle_ns_ += period_ns;
        if (!ticked_.wait_until(lock, until, [this] { return !ticks_.empty(); })) return {};
        const std::int64_t tick = ticks_.front();
        ticks_.pop_front();
        if (!tick_ || tick < *tick_ || tick - *tick_ > max_jump_ns_) {
            if (jumps_.size() < kMaxJumps) jumps_.push_back({tick_, tick});
            tick_ = tick;
            return cycle_ns_ = tick;
        }
        tick_ = tick;
    }
}

std::optional<ClockJump> SimulatedClock::takeJump() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (jumps_.empty()) return {};
    const ClockJump jump = jumps_.front();
    jumps_.pop_front();
    return jump;
}

std::optional<std::int64_t> SimulatedClock::now() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return tick_;
}

}  // namespace rtcf::executor
