/// @file
/// The one list of what depends on the inside of roscpp and rosconsole: functions of theirs that
/// this program replaces by its own of the same name, and English texts of theirs that it looks
/// for. Another version of them may have others, and then what stands here would silently not
/// work: so it is checked when the node starts, and the status says what failed.
#pragma once

#include <string>
#include <vector>

namespace rtcf::ros1 {

/// A function or a text, and what would not work without it.
struct Dependence {
    enum class Kind { Function, Text };
    Kind kind;
    const char* name;     ///< as the linker has it; or a part of the text
    const char* library;  ///< a part of its file's name
    const char* use;
};

/// All there are.
const std::vector<Dependence>& dependences();

/// What of these is not as it was when they were written, a line each. Any thread; not real-time.
std::vector<std::string> broken(const std::vector<Dependence>& list);

}  // namespace rtcf::ros1
