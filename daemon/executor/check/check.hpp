/// @file
/// `rtcf-executor --check`: runs one component for some cycles, with values on all inputs and taps
/// on all outputs, in a process that then ends. In the build with RealtimeSanitizer
/// (rtcf-executor-rtsan), everything that is not real-time safe is reported on standard error.
/// Standard output lists the activities, one per line.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace rtcf::executor {

struct CheckRequest {
    std::string library;
    std::string package;
    std::string type;
    std::uint64_t cycles = 1000;
    std::vector<std::string> parameters;  ///< "name:=value"; the value as in YAML
};

/// Runs the check.
/// @return exit status of the process: 0 = the cycles were run, 1 = rejected or faulted
int checkComponent(const CheckRequest& request);

}  // namespace rtcf::executor
