#include "runner/bridge_link.hpp"

#include <utility>

namespace rtcf::executor {

void BridgeLink::attach(RunnerView& runner, ParameterRequest change_parameters) {
    if (!bridge_) return;
    bridge_->serveParameters(std::move(change_parameters));
    bridge_->attach(runner);
}

void BridgeLink::configure(const BridgeSettings& settings) {
    if (bridge_) bridge_->configure(settings);
}

void BridgeLink::setTable(const Plan& plan, const GraphView& graph) {
    if (!bridge_) return;
    auto table = std::make_shared<BridgeTable>();
    if (served_) {
        *table = plan.bridgeTable();
        for (const auto& component : graph.components) {
            if (!component->parameters.empty()) table->parameters.push_back(component);
        }
    }
    bridge_->setTable(std::move(table));
}

void BridgeLink::serve(bool served, const Plan& plan, const GraphView& graph) {
    served_ = served;
    setTable(plan, graph);
}

void BridgeLink::setClock(const std::shared_ptr<SimulatedClock>& clock) {
    if (bridge_) bridge_->setClock(clock);
}

void BridgeLink::close() {
    if (bridge_) bridge_->setTable(std::make_shared<BridgeTable>());
}

}  // namespace rtcf::executor
