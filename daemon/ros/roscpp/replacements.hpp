/// @file
/// The list of dependences on internals of roscpp and rosconsole: functions that this program
/// replaces by its own of the same name, and texts that it searches for. In another version of
/// these libraries, they may differ, and the features that use them would silently fail. So they
/// are checked when the node starts, and the status reports failures.
#pragma once

#include <string>
#include <vector>

namespace rtcf::ros1 {

/// A function or a text, and the feature that uses it.
struct Dependence {
    enum class Kind { Function, Text };
    Kind kind;
    const char* name;     ///< linker symbol, or a part of the text
    const char* library;  ///< part of the library's file name
    const char* use;      ///< feature that uses it
};

/// All dependences.
const std::vector<Dependence>& dependences();

/// The dependences that are not met, one line each. Any thread; not real-time.
std::vector<std::string> broken(const std::vector<Dependence>& list);

}  // namespace rtcf::ros1
