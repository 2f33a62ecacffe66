/// @file
/// A latched stop: it begins with a condition, and ends only by a reset. Part of the state of its
/// component, which calls it in each cycle.
#pragma once

#include <cstdint>

namespace rtcf_control {

/// State of a stop, also the number that the components publish.
enum class StopState : std::int32_t {
    Running = 0,
    Stopped = 1,     ///< latched; the condition still holds, or no newer command has come
    Resettable = 2,  ///< latched; a reset ends it
    Waiting = 3,     ///< no command has come yet
};

/// All functions are real-time safe.
class Latch {
   public:
    bool stopped() const noexcept { return stopped_; }

    /// Number to publish.
    std::int32_t state() const noexcept {
        if (!stopped_) return static_cast<std::int32_t>(StopState::Running);
        return static_cast<std::int32_t>(fresh_ ? StopState::Resettable : StopState::Stopped);
    }

    /// Begins a stop.
    void stop() noexcept {
        stopped_ = true;
        fresh_ = false;
    }

    /// Runs one cycle.
    /// @param condition the reason to stop holds in this cycle
    /// @param command a new command has come in this cycle
    /// @param reset level of the reset input: only its change from false to true counts, so that a
    /// button that is stuck resets nothing
    /// @return true if this cycle ends the stop
    bool update(bool condition, bool command, bool reset) noexcept {
        const bool edge = reset && !reset_;
        reset_ = reset;
        if (condition) {
            stop();
            return false;
        }
        if (!stopped_) return false;
        fresh_ = fresh_ || command;
        if (!edge || !fresh_) return false;
        stopped_ = false;
        return true;
    }

    /// Names the members, as those of a state.
    template <typename Visit>
    void fields(Visit&& visit) {
        visit("stopped", stopped_);
        visit("fresh", fresh_);
        visit("reset", reset_);
    }

   private:
    bool stopped_ = false;
    bool fresh_ = false;  // a command has come after the reason to stop has ended
    bool reset_ = true;   // last level of the reset input: at first as if it was stuck
};

}  // namespace rtcf_control
