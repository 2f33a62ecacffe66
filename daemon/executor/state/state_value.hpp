/// @file
/// Conversion of a value from a user into the bytes of a declared state. Not real-time.
#pragma once

#include <cstddef>
#include <vector>

#include "rtcf/component.hpp"

namespace rtcf::executor {

/// Converts a value to the bytes of a state, which must be a number or a bool.
/// @param component name, for errors
/// @throws Error if the state is neither, or the value is not of its type
std::vector<std::byte> stateValue(const std::string& component, const StateDeclaration& state,
                                  const ParameterValue& value);

}  // namespace rtcf::executor
