#include "support/built_plans.hpp"

#include <memory>
#include <mutex>
#include <utility>

#include "ordering/plan.hpp"

// buildPlan()'s symbol name: a changed signature is an undefined symbol at link time.
#define RTCF_BUILD_PLAN                                                \
    "_ZN4rtcf8executor9buildPlanENS0_5GraphENS0_6WiringERKNS0_4PlanEd" \
    "RNS0_8AdoptionERKNS0_14BridgeSettingsE"

namespace rtcf::test {

using executor::Adoption;
using executor::BridgeSettings;
using executor::Graph;
using executor::Plan;
using executor::Wiring;

std::unique_ptr<Plan> realBuildPlan(Graph graph, Wiring wiring, const Plan& previous,
                                    double frequency_hz, Adoption& adoption,
                                    const BridgeSettings& bridge) asm("__real_" RTCF_BUILD_PLAN);
std::unique_ptr<Plan> notedBuildPlan(Graph graph, Wiring wiring, const Plan& previous,
                                     double frequency_hz, Adoption& adoption,
                                     const BridgeSettings& bridge) asm("__wrap_" RTCF_BUILD_PLAN);

namespace {

std::mutex mutex;
BuiltPlans built;

}  // namespace

std::unique_ptr<Plan> notedBuildPlan(Graph graph, Wiring wiring, const Plan& previous,
                                     double frequency_hz, Adoption& adoption,
                                     const BridgeSettings& bridge) {
    std::unique_ptr<Plan> plan = realBuildPlan(std::move(graph), std::move(wiring), previous,
                                               frequency_hz, adoption, bridge);
    const std::lock_guard<std::mutex> lock(mutex);
    built = {built.count + 1, plan->schedule.selective};
    return plan;
}

BuiltPlans builtPlans() {
    const std::lock_guard<std::mutex> lock(mutex);
    return built;
}

}  // namespace rtcf::test
