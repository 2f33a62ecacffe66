/// @file
/// Conversion of the executor's types to the wire's messages. Pure functions.
#pragma once

#include "bridge/outside_call.hpp"
#include "graph/definition.hpp"
#include "logging/log.hpp"
#include "rtcf/executor/v1/executor.pb.h"
#include "runner/change_outcome.hpp"
#include "runner/replay.hpp"
#include "runner/runner_event.hpp"
#include "runner/snapshots.hpp"
#include "runner/value_changes.hpp"
#include "view/graph_view.hpp"

namespace rtcf::executor {

::rtcf::v1::ComponentSpec specTo(const ComponentDefinition& definition);
::rtcf::v1::RunnerState stateTo(RunnerState state);
/// Sets the runner's state in a response.
void setState(v1::Response& response, const NumberedState& state);
::rtcf::v1::ChangeResult outcomeTo(const ChangeOutcome& outcome);
/// @throws Error if it is too large for the wire
v1::Snapshot snapshotTo(const SnapshotOutcome& outcome);
v1::InputType inputTypeTo(const WritableInput& input);
v1::LogRecord logTo(const LogEntry& entry);
v1::ServiceCall callTo(std::uint64_t number, const OutsideCall& call);
v1::Event eventTo(const RunnerEvent& event);
::rtcf::v1::ComponentInfo componentTo(const GraphView& graph, std::size_t position,
                                      RunnerState state);
/// Adds values of Runner::probe(), inputs first.
void addValues(::rtcf::v1::ComponentInfo& info, const std::vector<Probe::Value>& values);
/// Adds values of Runner::states().
void addStates(::rtcf::v1::ComponentInfo& info, const std::vector<std::string>& values);
v1::ListConnectionsResult connectionsTo(const GraphView& graph);
/// Describes a component that is not loaded; its ports have no mapped names.
::rtcf::v1::ComponentType typeTo(const std::string& package, const std::string& library,
                                 const ComponentRecord& record, const Component& component);
::rtcf::v1::ReplayResponse replayTo(ReplayOutcome outcome);

}  // namespace rtcf::executor
