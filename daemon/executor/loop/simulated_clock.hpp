/// @file
/// The clock of a simulation: one thread delivers ticks, and the loop's thread waits for the cycles
/// that are due. Each tick makes as many cycles due as whole periods have passed, each with its own
/// exact time. Owned by Simulation. Not real-time, as a simulated loop is not.
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
    std::int64_t time_ns = 0;  ///< simulated
    /// CLOCK_MONOTONIC; messages that arrived until then are older than the cycle
    std::int64_t arrived_ns = 0;
    double rate = 0.0;  ///< simulated time per real time since the last cycle; 0 = start or jump
};

/// A tick that restarts the count of cycles: the first one, one far back, or one too far ahead.
struct ClockJump {
    std::optional<std::int64_t> from_ns;  ///< previous tick; unset = this is the first one
    std::int64_t to_ns = 0;
};

/// Ticks that were a little earlier than the ones before them, as of a bag that is played, or of
/// two clocks. No cycle runs until the clock has caught up.
struct ClockSteps {
    std::uint64_t count = 0;
    std::int64_t longest_ns = 0;
};

class SimulatedClock {
   public:
    /// Longest step back that is not a jump. Longer than the jitter of a clock, and much shorter
    /// than a simulation or a bag that begins again.
    static constexpr std::int64_t kLongestStep = 100'000'000;

    /// @name The thread that delivers ticks
    /// @{
    /// Sets the clock to `now_ns` (since 1970 or any other epoch). Returns at once.
    /// @param arrived_ns arrival of the tick, CLOCK_MONOTONIC; comparable with the arrival of
    /// inputs
    void tick(std::int64_t now_ns, std::int64_t arrived_ns);
    /// @}

    /// @name The thread that starts the loop, while it does not run
    /// @{
    /// Removes all ticks.
    /// @param max_jump_ns a longer step forward is a jump
    void reset(std::int64_t max_jump_ns);
    /// @}

    /// @name The loop's thread
    /// @{
    /// Waits for the next cycle to be due.
    /// @return nothing if none was due within `patience`
    std::optional<SimulatedCycle> next(std::int64_t period_ns, std::chrono::milliseconds patience);
    /// @}

    /// @name Any thread
    /// @{
    /// Takes the oldest jump.
    std::optional<ClockJump> takeJump();
    /// Takes the steps back since the last call.
    ClockSteps takeSteps();
    /// Arrival of the last tick that changed the time; unset = none since reset().
    std::optional<std::int64_t> lastMove() const;
    /// The last tick that the loop has reached.
    std::optional<std::int64_t> now() const;
    /// @}

   private:
    // If there are more, the loop cannot keep up. Ticks are then merged, which does not change the
    // number of cycles.
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
    std::deque<Tick> ticks_;       // not reached yet
    std::optional<Tick> tick_;     // last tick reached
    Tick before_{};                // the tick before tick_; after a jump, tick_ itself
    std::int64_t cycle_ns_ = 0;    // time of the last cycle
    std::int64_t arrived_ns_ = 0;  // its arrival time
    std::int64_t max_jump_ns_ = INT64_MAX;
    std::deque<ClockJump> jumps_;
    ClockSteps steps_;
    std::optional<Tick> moved_;  // newest tick that changed the time
};

}  // namespace rtcf::executor
