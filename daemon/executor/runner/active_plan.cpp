#include "runner/active_plan.hpp"

#include <vector>

namespace rtcf::executor {

void ActivePlan::startComponents(const Progress& progress,
                                 const std::function<void()>& require_go) {
    std::vector<Instance*> started;
    try {
        for (const std::size_t index : plan_->wiring.order) {
            Instance& instance = *plan_->graph.nodes()[index].instance;
            progress("starting " + instance.fullName());
            require_go();
            started.push_back(&instance);
            instance.setFault({});
            instance.start();
        }
        require_go();
    } catch (...) {
        for (auto instance = started.rbegin(); instance != started.rend(); ++instance)
            (*instance)->stop();
        throw;
    }
}

void ActivePlan::stopComponents() noexcept {
    // In reverse order of execution, so that a component's writers run as long as it does.
    for (auto index = plan_->wiring.order.rbegin(); index != plan_->wiring.order.rend(); ++index) {
        plan_->graph.nodes()[*index].instance->stop();
    }
}

}  // namespace rtcf::executor
