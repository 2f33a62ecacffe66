/// @file
/// A parameter's value between the wire's message and the executor's own type. Pure functions.
#pragma once

#include <string>

#include "rtcf/parameter.hpp"
#include "rtcf/v1/graph.pb.h"

namespace rtcf::executor {

/// @param name of the parameter, for messages @throws Refusal if it is none
ParameterValue parameterValueFrom(const ::rtcf::v1::ParameterValue& value, const std::string& name);
::rtcf::v1::ParameterValue parameterValueTo(const ParameterValue& value);

}  // namespace rtcf::executor
