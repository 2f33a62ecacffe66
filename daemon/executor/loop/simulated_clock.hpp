/// @file
/// The clock of a simulation: one thread brings its ticks, the loop's thread
/// asks for the cycles that are due by them. For each tick there are as many
/// cycles as whole periods have passed, each with its own exact time. The
/// runner owns it; nothing here is real-time, as a simulated loop is not.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>

namespace rtcf::executor {

/// A cycle that is due.
struct SimulatedCycle {
    std::int64_t time_ns = 0;     ///< simulated
    std::int64_t arrived_ns = 0;  ///< CLOCK_MONOTONIC; what came until then is older than the cycle
    double rate = 0.0;  ///< at which it went on since the last cycle; 0 = it began or leapt
};

/// A tick from which the cycles are counted anew: the clock began, went back, or leapt.
struct ClockJump {
    std::optional<std::int64_t> from_ns;  ///< the tick before; none = this is the first
    std::int64_t to_ns = 0;
};

class SimulatedClock {
   public:
    /// @name The thread that brings the ticks
    /// @{
    /// The clock shows `now_ns` (since 1970 or any other zero). Returns at once.
    /// @param arrived_ns when the tick came, CLOCK_MONOTONIC, on the clock by which inputs come
    void tick(std::int64_t now_ns, std::int64_t arrived_ns);
    /// @}

    /// @name The thread that starts the loop, while it does not run
    /// @{
    /// Forgets all ticks. @param max_jump_ns a longer way forward is a jump
    void reset(std::int64_t max_jump_ns);
    /// @}

    /// @name The loop's thread
    /// @{
    /// Waits for the next cycle to be due. @return nothing if none was within `patience`
    std::optional<SimulatedCycle> next(std::int64_t period_ns, std::chrono::milliseconds patience);
    /// @}

    /// @name Any thread
    /// @{
    /// Takes the oldest jump that has not been taken yet.
    std::optional<ClockJump> takeJump();
    /// The last tick that the loop has got to.
    std::optional<std::int64_t> now() const;
    /// @}

   private:
    // More is a loop that cannot keep up; ticks are then merged, which changes no count of cycles.
    static constexpr std::size_t kMaxTicks = 65536;
    static constexpr std::size_t kMaxJumps = 64;

    struct Tick {
        std::int64_t time_ns;
        std::int64_t arrived_ns;
    };

    std::int64_t arrival() const;
    SimulatedCycle goOn(std::int64_t period_ns);

    mutable std::mutex mutex_;
    std::condition_variable ticked_;
    std::deque<Tick> ticks_;       // to be worked off
    std::optional<Tick> tick_;     // that is being worked off
    Tick before_{};                // the one before it, or itself
    std::int64_t cycle_ns_ = 0;    // time of the last cycle
    std::int64_t arrived_ns_ = 0;  // and when that was
    std::int64_t max_jump_ns_ = INT64_MAX;
    std::deque<ClockJump> jumps_;
};

}  // namespace rtcf::executor
