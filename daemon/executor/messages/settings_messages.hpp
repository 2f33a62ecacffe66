/// @file
/// Conversion of settings and access rules between the wire's messages and the executor's types.
/// Pure functions.
#pragma once

#include "access/rights.hpp"
#include "rtcf/executor/v1/executor.pb.h"
#include "view/settings.hpp"

namespace rtcf::executor {

/// Returns `base` with the fields that the message sets.
/// @throws Error on invalid values
RunnerSettings settingsFrom(const ::rtcf::v1::RunnerSettings& message, RunnerSettings base);
::rtcf::v1::RunnerSettings settingsTo(const RunnerSettings& settings);
AccessRules rulesFrom(const v1::AccessRules& message);

}  // namespace rtcf::executor
