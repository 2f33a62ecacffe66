/// @file
/// The loop breaks of one component: its inputs that read the value of the previous cycle.
#pragma once

#include <set>
#include <string>

#include "names/name_pattern.hpp"

namespace rtcf::executor {

struct LoopBreaks {
    bool first = false;           ///< of all inputs; the component runs as early as possible
    NamePattern ignore;           ///< of the inputs whose mapped names match
    std::set<std::string> ports;  ///< of these inputs

    bool include(const std::string& port, const std::string& mapped_name) const {
        return first || ports.count(port) != 0 || ignore.matches(mapped_name);
    }

    bool operator==(const LoopBreaks& other) const {
        return first == other.first && ignore.text() == other.ignore.text() && ports == other.ports;
    }
    bool operator!=(const LoopBreaks& other) const { return !(*this == other); }
};

}  // namespace rtcf::executor
