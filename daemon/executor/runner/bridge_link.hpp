/// @file
/// The bridge of a runner, if there is one, and its table of connections. Owned by the runner;
/// graph thread, if not stated otherwise.
#pragma once

#include <memory>

#include "bridge/bridge.hpp"
#include "ordering/plan.hpp"
#include "view/graph_view.hpp"

namespace rtcf::executor {

class BridgeLink {
   public:
    /// @param bridge null = none
    explicit BridgeLink(std::unique_ptr<Bridge> bridge) : bridge_(std::move(bridge)) {}

    /// Sets the runner and the function that changes parameters. Called once, by any thread.
    void attach(RunnerView& runner, ParameterRequest change_parameters);
    void configure(const BridgeSettings& settings);
    /// Gives the bridge the connections of a plan and the parameters of its graph view.
    void setTable(const Plan& plan, const GraphView& graph);
    /// Disconnects the bridge from all ports, or connects it again.
    void serve(bool served, const Plan& plan, const GraphView& graph);
    /// Sets the receiver of the peers' simulated clock; null = none.
    void setClock(const std::shared_ptr<SimulatedClock>& clock);
    /// Disconnects the bridge from all ports, for good.
    void close();
    /// Destroys the bridge.
    void reset() { bridge_.reset(); }

    bool exists() const noexcept { return bridge_ != nullptr; }
    BridgeStatus status() const { return bridge_ ? bridge_->status() : BridgeStatus{}; }
    /// True if a peer that publishes the injector's topic is connected.
    bool feeds(const Injector& injector) const { return bridge_ && bridge_->feeds(injector); }
    /// Access of hooks to the outside; null = none.
    HookGate* hooks() const noexcept { return bridge_ ? bridge_->hooks() : nullptr; }

   private:
    std::unique_ptr<Bridge> bridge_;
    bool served_ = true;
};

}  // namespace rtcf::executor
