/// @file
/// State and status of a runner.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "bridge/bridge.hpp"
#include "view/settings.hpp"

namespace rtcf::executor {

enum class RunnerState { Stopped, Running, Faulted, Stuck, Stepping };

/// A state with its number; of two states, the one with the higher number is newer.
struct NumberedState {
    RunnerState state = RunnerState::Stopped;
    std::uint32_t number = 0;
};

/// Status of a runner, for queries.
struct RunnerStatus {
    RunnerState state = RunnerState::Stopped;
    std::uint32_t state_number = 0;  ///< see NumberedState
    RunnerSettings settings;
    std::vector<std::string> degraded;  ///< missing prerequisites of real time, one line each
    std::string loop_fault;             ///< the fault that ended the loop; empty = none
    BridgeStatus bridge;
    bool simulated = false;       ///< the loop follows a simulated clock
    std::string clock_silence;    ///< why no simulated cycle runs; empty = the clock moves
    std::uint64_t too_large = 0;  ///< messages lost because of their size
};

}  // namespace rtcf::executor
