/// @file
/// Numbers of tests of components that run alone.
#pragma once

#include <limits>

namespace rtcf::test {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kStep = 1e-3;      // s, the period of a Bench unless a test sets another
constexpr double kRounding = 1e-9;  // permitted error of values of size 1

}  // namespace rtcf::test
