/// @file
/// The settings of a runner as the executor uses them, checked.
#pragma once

#include <string>

#include "bridge/bridge.hpp"
#include "loop/loop.hpp"

namespace rtcf::executor {

/// Whether a loop follows the simulated clock of its peers.
enum class SimTime {
    Auto,  ///< if they do
    Never,
    Always
};

struct RunnerSettings {
    double frequency_hz = 1000.0;
    LoopSettings loop;  ///< its period follows frequency_hz
    bool realtime_required = false;
    bool spin_auto = false;  ///< loop.spin_ns follows the observed wake-up latency
    std::int64_t stall_timeout_ns = 2'000'000'000;  ///< a component that does not return; 0 = never
    std::int64_t orphan_timeout_ns = 60'000'000'000;  ///< without a daemon; 0 = at once
    int on_boot = 0;                                  ///< rtcfd's, kept for it
    int on_crash = 0;                                 ///< rtcfd's, kept for it
    std::uint32_t log_limit = 100;  ///< records of one line of a component in a second; 0 = any
    std::size_t frame_bytes = std::size_t{64} * 1024;  ///< of values that a cycle keeps
    BridgeSettings bridge;
    SimTime sim_time = SimTime::Auto;
    std::int64_t max_clock_jump_ns = 10'000'000'000;  ///< further forward, a simulation begins anew
    std::string whitelist;                            ///< regular expressions over mapped names
    std::string blacklist;
};

/// @throws Refusal that names the setting, its value and its range. Also brings
/// the derived period in step.
void validate(RunnerSettings& settings);

}  // namespace rtcf::executor
