/// @file
/// A graph prepared for the loop: its schedule, and all objects that the schedule's pointers refer
/// to. A new plan is built from the loop's present one and reuses its objects where possible, so
/// that running connections are undisturbed. Graph thread only.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "bridge/bridge.hpp"
#include "graph/graph.hpp"
#include "loop/adoption.hpp"
#include "loop/schedule.hpp"
#include "ordering/wiring.hpp"

namespace rtcf::executor {

/// The source of an input, and the owners that keep it alive.
struct Binding {
    /// The output's slot, or the injector; null = no writer any more.
    const void* writer = nullptr;
    const SlotHeader* source = nullptr;  ///< slot that the input reads; null with an injector
    std::shared_ptr<const void> source_owner;
    /// Slot of an earlier writer's value that the input may still read, until the present one
    /// writes.
    const SlotHeader* held = nullptr;
    std::shared_ptr<const void> held_owner;
};

struct Plan {
    Graph graph;
    Wiring wiring;
    Schedule schedule;
    std::map<const InputPort*, Binding> bindings;
    std::map<const SlotHeader*, std::shared_ptr<SlotHeader>> latches;  ///< by the writer's slot
    /// @name By topic; by topic and port if the topic has several writers.
    /// @{
    std::map<std::string, std::shared_ptr<SerializedTap>> serialized_taps;
    std::map<std::string, std::shared_ptr<FrameTap>> frame_taps;
    /// @}
    std::map<std::string, std::shared_ptr<Injector>> injectors;  ///< by topic

    /// Records the earlier values that inputs still refer to. After the loop has adopted the plan.
    void noteHeld(const Adoption& adoption, const Plan& previous) noexcept;

    BridgeTable bridgeTable() const;
};

/// Builds a plan.
/// @param previous the plan that the loop executes
/// @param frequency_hz the loop's frequency, for the sizes of serialized taps
/// @param adoption receives the schedule and the inputs to rewire
/// @param bridge decimation and sizes of values that leave and enter the loop
/// @throws Error if the taps' rings would take too much memory
std::unique_ptr<Plan> buildPlan(Graph graph, Wiring wiring, const Plan& previous,
                                double frequency_hz, Adoption& adoption,
                                const BridgeSettings& bridge = {});

}  // namespace rtcf::executor
