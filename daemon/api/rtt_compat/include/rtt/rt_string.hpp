/// @file
/// OROCOS' string of a memory pool of its own. There is no such pool: fill what grows outside of
/// the loop, and within it copy no more than its capacity.
#pragma once

#include <string>

namespace RTT {

using rt_string = std::string;

}  // namespace RTT
