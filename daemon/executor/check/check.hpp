/// @file
/// `rtcf-executor --check`: runs one component for some cycles, with values on
/// all its inputs and taps on all its outputs, in this process, which does
/// nothing else and then ends. In the build with RealtimeSanitizer
/// (rtcf-executor-rtsan) everything that is not real-time safe is reported on
/// standard error. Standard output tells line by line what runs.
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
    std::vector<std::string> parameters;  ///< "name:=value", a value as in YAML
};

/// @return the process's exit status: 0 the cycles were run, 1 refused or faulted
int checkComponent(const CheckRequest& request);

}  // namespace rtcf::executor
