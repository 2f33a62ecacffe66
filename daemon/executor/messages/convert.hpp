/// @file
/// Between the wire's messages and the executor's own types. Generated types go
/// no further than this folder. Pure functions.
#pragma once

#include "access/rights.hpp"
#include "bridge/outside_call.hpp"
#include "graph/definition.hpp"
#include "logging/log.hpp"
#include "refusal.hpp"
#include "rtcf/executor/v1/executor.pb.h"
#include "runner/runner.hpp"
#include "server/direct_stop.hpp"
#include "view/settings.hpp"
#include "view/snapshot.hpp"

namespace rtcf::executor {

/// @name From the wire; throw Refusal on what is not legal
/// @{
ComponentDefinition definitionFrom(const ::rtcf::v1::ComponentSpec& spec);
/// What is empty in a replacement is that of the component it replaces.
ComponentDefinition replacementFrom(const ::rtcf::v1::ComponentSpec& spec,
                                    const ComponentDefinition& old);
/// `base` with what the message sets.
RunnerSettings settingsFrom(const ::rtcf::v1::RunnerSettings& message, RunnerSettings base);
std::vector<std::pair<std::string, ParameterValue>> parametersFrom(
    const google::protobuf::RepeatedPtrField<::rtcf::v1::ParameterSetting>& settings);
ReplayChunk replayFrom(const ::rtcf::v1::ReplayRequest& request);
AccessRules rulesFrom(const v1::AccessRules& message);
/// @}

/// @name To the wire
/// @{
v1::Error errorTo(RefusalKind kind, const std::string& message);
::rtcf::v1::ChangeResult outcomeTo(const ChangeOutcome& outcome);
/// @throws Refusal if it is too large for the wire
v1::Snapshot snapshotTo(const ImageOutcome& outcome);
v1::LogRecord logTo(const LogEntry& entry);
v1::ServiceCall callTo(std::uint64_t number, const OutsideCall& call);
v1::DirectStop directStopTo(const DirectStopReport& report);
v1::Event eventTo(const RunnerEvent& event);
::rtcf::v1::ComponentInfo componentTo(const GraphSnapshot& snapshot, std::size_t position,
                                      RunnerState state);
/// Adds what probe() found, inputs first.
void addValues(::rtcf::v1::ComponentInfo& info, const std::vector<Probe::Value>& values);
/// Adds what Runner::states() found.
void addStates(::rtcf::v1::ComponentInfo& info, const std::vector<std::string>& values);
v1::ListConnectionsResult connectionsTo(const GraphSnapshot& snapshot);
/// Of a component that is not loaded: its ports have no mapped names.
::rtcf::v1::ComponentType typeTo(const std::string& package, const std::string& library,
                                 const ComponentRecord& record, const Component& component);
::rtcf::v1::ReplayResponse replayTo(ReplayOutcome outcome);
::rtcf::v1::RunnerSettings settingsTo(const RunnerSettings& settings);
/// @}

}  // namespace rtcf::executor
