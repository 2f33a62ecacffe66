/// @file
/// `rtcf-executor --check-settings`: checks settings with the executor's own code, in a process
/// that does nothing else.
#pragma once

namespace rtcf::executor {

/// Reads a RunnerSettings message from standard input; unset fields have their defaults.
/// @return exit status of the process
/// @throws Error if a setting is invalid
int checkSettings();

}  // namespace rtcf::executor
