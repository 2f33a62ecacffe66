/// @file
/// The wire's messages as the executor's own types. Generated types go no further than this folder
/// and the server's. Pure functions; they throw Refusal on what is not legal.
#pragma once

#include "graph/definition.hpp"
#include "rtcf/executor/v1/executor.pb.h"
#include "runner/runner.hpp"

namespace rtcf::executor {

ComponentDefinition definitionFrom(const ::rtcf::v1::ComponentSpec& spec);
/// What is empty in a replacement is that of the component it replaces.
ComponentDefinition replacementFrom(const ::rtcf::v1::ComponentSpec& spec,
                                    const ComponentDefinition& old);
std::vector<std::pair<std::string, ParameterValue>> parametersFrom(
    const google::protobuf::RepeatedPtrField<::rtcf::v1::ParameterSetting>& settings);
ReplayChunk replayFrom(const ::rtcf::v1::ReplayRequest& request);

}  // namespace rtcf::executor
