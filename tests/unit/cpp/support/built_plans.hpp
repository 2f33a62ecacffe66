/// @file
/// What the executor's plans looked like when they were built: the linker hands each call of
/// buildPlan() of this program on by way of here (see --wrap in CMakeLists.txt).
#pragma once

#include <cstddef>

namespace rtcf::test {

/// Of all runners of the program; any thread.
struct BuiltPlans {
    std::size_t count = 0;   ///< so far
    bool selective = false;  ///< the last one's cycles take the long way
};

BuiltPlans builtPlans();

}  // namespace rtcf::test
