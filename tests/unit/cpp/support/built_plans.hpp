/// @file
/// Counts the executor's plans when they are built: the linker redirects each call of
/// buildPlan() in this program to here (see --wrap in CMakeLists.txt).
#pragma once

#include <cstddef>

namespace rtcf::test {

/// Plans of all runners of the program; any thread.
struct BuiltPlans {
    std::size_t count = 0;   ///< so far
    bool selective = false;  ///< whether the last one's cycles can take components out
};

BuiltPlans builtPlans();

}  // namespace rtcf::test
