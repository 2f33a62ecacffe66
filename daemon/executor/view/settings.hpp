/// @file
/// Validated settings of a runner.
#pragma once

#include <string>

#include "bridge/bridge.hpp"
#include "loop/loop.hpp"

namespace rtcf::executor {

/// Use of the peers' simulated clock.
enum class SimTime {
    Auto,  ///< if the peers use it
    Never,
    Always
};

struct RunnerSettings {
    double frequency_hz = 1000.0;
    LoopSettings loop;  ///< validate() sets its period from frequency_hz
    bool realtime_required = false;
    bool spin_auto = false;  ///< loop.spin_ns follows the observed wake-up latency
    std::int64_t stall_timeout_ns = 2'000'000'000;  ///< limit of a hook in the cycle; 0 = none
    std::int64_t hook_timeout_ns = 10'000'000'000;  ///< limit of a hook outside the cycle
    /// The loop stops after this time without rtcfd; 0 = at once.
    std::int64_t orphan_timeout_ns = 60'000'000'000;
    int on_boot = 0;   ///< stored for rtcfd
    int on_crash = 0;  ///< stored for rtcfd
    /// Records per second from one line of a component; 0 = no limit.
    std::uint32_t log_limit = 100;
    /// Most bytes of states and staged outputs per frame.
    std::size_t frame_bytes = std::size_t{64} * 1024;
    BridgeSettings bridge;
    SimTime sim_time = SimTime::Auto;
    /// A larger step forward restarts the simulated clock.
    std::int64_t max_clock_jump_ns = 10'000'000'000;
    std::string whitelist;  ///< regular expressions over mapped names
    std::string blacklist;
};

/// Checks the settings, and sets the loop's period.
/// @throws Error that names the setting, its value and its range
void validate(RunnerSettings& settings);

}  // namespace rtcf::executor
