/// @file
/// Conversion of the wire's messages to the executor's types. Only this folder and the server use
/// generated types. Pure functions, which throw Error on invalid values.
#pragma once

#include "graph/definition.hpp"
#include "rtcf/executor/v1/executor.pb.h"
#include "runner/replay.hpp"

namespace rtcf::executor {

ComponentDefinition definitionFrom(const ::rtcf::v1::ComponentSpec& spec);
/// Empty fields of `spec` get the values of the replaced component.
ComponentDefinition replacementFrom(const ::rtcf::v1::ComponentSpec& spec,
                                    const ComponentDefinition& old);
std::vector<std::pair<std::string, ParameterValue>> parametersFrom(
    const google::protobuf::RepeatedPtrField<::rtcf::v1::ParameterSetting>& settings);
ReplayChunk replayFrom(const ::rtcf::v1::ReplayRequest& request);

}  // namespace rtcf::executor
