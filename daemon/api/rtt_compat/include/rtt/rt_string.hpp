/// @file
/// OROCOS' string with its own memory pool. Here it is a std::string: let it grow only outside of
/// the loop, and within the loop copy no more than its capacity.
#pragma once

#include <string>

namespace RTT {

using rt_string = std::string;

}  // namespace RTT
