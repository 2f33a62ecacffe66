/// @file
/// Conversion of a parameter's value between the wire's message and the executor's type. Pure
/// functions.
#pragma once

#include <string>

#include "rtcf/parameter.hpp"
#include "rtcf/v1/graph.pb.h"

namespace rtcf::executor {

/// @param name name of the parameter, for errors
/// @throws Error if the message has no value
ParameterValue parameterValueFrom(const ::rtcf::v1::ParameterValue& value, const std::string& name);
::rtcf::v1::ParameterValue parameterValueTo(const ParameterValue& value);

}  // namespace rtcf::executor
