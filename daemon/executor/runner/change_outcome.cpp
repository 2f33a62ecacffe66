#include "runner/change_outcome.hpp"

namespace rtcf::executor {

ChangeOutcome outcomeWith(const Plan& plan, std::string component) {
    ChangeOutcome result;
    result.generation = plan.schedule.generation;
    for (const std::size_t index : plan.wiring.order) {
        result.order.push_back(plan.graph.nodes()[index].instance->fullName());
    }
    result.component = std::move(component);
    return result;
}

}  // namespace rtcf::executor
