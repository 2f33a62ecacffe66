/// @file
/// A value for a declared state, as somebody outside gives it. Not real-time.
#pragma once

#include <cstddef>
#include <vector>

#include "rtcf/component.hpp"

namespace rtcf::executor {

/// The bytes of a value of a state's type, which is a number or a bool.
/// @param component for messages
/// @throws Refusal if the state is neither, or the value is none of its type
std::vector<std::byte> stateValue(const std::string& component, const StateDeclaration& state,
                                  const ParameterValue& value);

}  // namespace rtcf::executor
