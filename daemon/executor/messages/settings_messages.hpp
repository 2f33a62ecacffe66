/// @file
/// Settings and rules between the wire's messages and the executor's own types. Pure functions.
#pragma once

#include "access/rights.hpp"
#include "rtcf/executor/v1/executor.pb.h"
#include "view/settings.hpp"

namespace rtcf::executor {

/// `base` with what the message sets. @throws Refusal on what is not legal
RunnerSettings settingsFrom(const ::rtcf::v1::RunnerSettings& message, RunnerSettings base);
::rtcf::v1::RunnerSettings settingsTo(const RunnerSettings& settings);
AccessRules rulesFrom(const v1::AccessRules& message);

}  // namespace rtcf::executor
