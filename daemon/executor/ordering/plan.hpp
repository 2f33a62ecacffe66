/// @file
/// A graph made ready for the loop: its schedule, and everything that the
/// schedule's pointers point to. A new plan is built from the one that the loop
/// has; what stays is taken over, so that running connections are undisturbed.
/// Graph thread only.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "bridge/bridge.hpp"
#include "graph/graph.hpp"
#include "loop/schedule.hpp"
#include "ordering/wiring.hpp"

namespace rtcf::executor {

/// Where an input reads, and who keeps that place alive.
struct Binding {
    const void* writer = nullptr;  ///< the output's slot or the injector; null = none any more
    const SlotHeader* source = nullptr;  ///< null with an injector
    std::shared_ptr<const void> source_owner;
    const SlotHeader* kept = nullptr;  ///< of an earlier writer, as long as it may be read
    std::shared_ptr<const void> kept_owner;
};

struct Plan {
    Graph graph;
    Wiring wiring;
    Schedule schedule;
    std::map<const InputBase*, Binding> bindings;
    std::map<const SlotHeader*, std::shared_ptr<SlotHeader>> latches;  ///< by the writer's slot
    std::map<std::string, std::shared_ptr<Tap>>
        taps;  ///< by topic, and by port where a topic has several writers
    std::map<std::string, std::shared_ptr<Injector>> injectors;  ///< by topic

    /// Notes which earlier values inputs still refer to, once the loop has adopted the plan.
    void noteKept(const Adoption& adoption, const Plan& previous) noexcept;

    BridgeTable bridgeTable() const;
};

/// Builds a plan.
/// @param previous the plan that the loop executes
/// @param frequency_hz of the loop; sizes the taps' rings
/// @param adoption gets the schedule and the inputs to rewire
/// @param bridge decimation and sizes of what leaves and enters the loop
/// @throws Refusal if the taps' rings would take too much memory
std::unique_ptr<Plan> buildPlan(Graph graph, Wiring wiring, const Plan& previous,
                                double frequency_hz, Adoption& adoption,
                                const BridgeSettings& bridge = {});

}  // namespace rtcf::executor
