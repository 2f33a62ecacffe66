#include "loop/simulated_clock.hpp"

#include <algorithm>
#include <utility>

namespace rtcf::executor {

void SimulatedClock::tick(std::int64_t now_ns, std::int64_t arrived_ns) {
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (ticks_.size() < kMaxTicks) {
            ticks_.push_back({now_ns, arrived_ns});
        } else {
            ticks_.back() = {now_ns, arrived_ns};
        }
        if (!moved_ || moved_->time_ns != now_ns) moved_ = {now_ns, arrived_ns};
    }
    ticked_.notify_one();
}

void SimulatedClock::reset(std::int64_t max_jump_ns) {
    const std::lock_guard<std::mutex> lock(mutex_);
    ticks_.clear();
    tick_.reset();
    jumps_.clear();
    steps_ = {};
    moved_.reset();
    max_jump_ns_ = max_jump_ns;
}

std::optional<SimulatedCycle> SimulatedClock::next(std::int64_t period_ns,
                                                   std::chrono::milliseconds patience) {
    const auto until = std::chrono::steady_clock::now() + patience;
    std::unique_lock<std::mutex> lock(mutex_);
    while (true) {
        if (tick_ && tick_->time_ns - cycle_ns_ >= period_ns) {
            return goOn(period_ns);
        }
        if (!ticked_.wait_until(lock, until, [this] { return !ticks_.empty(); })) return {};
        const Tick tick = ticks_.front();
        ticks_.pop_front();
        const std::int64_t step = tick_ ? tick_->time_ns - tick.time_ns : 0;
        if (step > 0 && step <= kLongestStep) {
            ++steps_.count;
            steps_.longest_ns = std::max(steps_.longest_ns, step);
            continue;
        }
        const std::optional<Tick> last = std::exchange(tick_, tick);
        before_ = last.value_or(tick);
        const std::int64_t leap = tick.time_ns - before_.time_ns;
        if (last && leap >= 0 && leap <= max_jump_ns_) continue;
        if (jumps_.size() < kMaxJumps) {
            jumps_.push_back({last ? std::optional(last->time_ns) : std::nullopt, tick.time_ns});
        }
        before_ = tick;
        cycle_ns_ = tick.time_ns;
        arrived_ns_ = tick.arrived_ns;
        return SimulatedCycle{cycle_ns_, arrived_ns_, 0.0};
    }
}

// Arrival time of the present cycle, by linear interpolation between the last two ticks.
std::int64_t SimulatedClock::arrival() const {
    const std::int64_t span = tick_->time_ns - before_.time_ns;
    if (span <= 0) return tick_->arrived_ns;
    const double left = static_cast<double>(tick_->time_ns - cycle_ns_) / static_cast<double>(span);
    const auto wait = static_cast<double>(tick_->arrived_ns - before_.arrived_ns);
    return tick_->arrived_ns - static_cast<std::int64_t>(left * wait);
}

SimulatedCycle SimulatedClock::goOn(std::int64_t period_ns) {
    cycle_ns_ += period_ns;
    const std::int64_t last = std::exchange(arrived_ns_, arrival());
    const std::int64_t wait = arrived_ns_ - last;
    return {cycle_ns_, arrived_ns_,
            wait > 0 ? static_cast<double>(period_ns) / static_cast<double>(wait) : 0.0};
}

std::optional<ClockJump> SimulatedClock::takeJump() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (jumps_.empty()) return {};
    const ClockJump jump = jumps_.front();
    jumps_.pop_front();
    return jump;
}

ClockSteps SimulatedClock::takeSteps() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return std::exchange(steps_, {});
}

std::optional<std::int64_t> SimulatedClock::lastMove() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return moved_ ? std::optional(moved_->arrived_ns) : std::nullopt;
}

std::optional<std::int64_t> SimulatedClock::now() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return tick_ ? std::optional(tick_->time_ns) : std::nullopt;
}

}  // namespace rtcf::executor
