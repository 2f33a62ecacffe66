/// @file
/// `rtcf-executor --check-settings`: whether an executor would take settings,
/// by the code that takes them, in a process that does nothing else.
#pragma once

namespace rtcf::executor {

/// Reads a RunnerSettings from standard input; what it does not set is as by default.
/// @return the process's exit status
/// @throws Refusal saying what is wrong with them
int checkSettings();

}  // namespace rtcf::executor
