/// @file
/// The settings of a runner as the executor uses them, checked.
#pragma once

#include <string>

#include "bridge/bridge.hpp"
#include "loop/loop.hpp"

namespace rtcf::executor {

struct RunnerSettings {
    double frequency_hz = 1000.0;
    LoopSettings loop;             ///< its period follows frequency_hz
    bool realtime_required = false;
    BridgeSettings bridge;
    std::string whitelist;         ///< regular expressions over mapped names
    std::string blacklist;
};

/// @throws Refusal that names the setting, its value and its range. Also brings
/// the derived period in step.
void validate(RunnerSettings& settings);

}  // namespace rtcf::executor
