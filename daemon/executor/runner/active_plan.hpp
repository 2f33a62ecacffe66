/// @file
/// The plan that the loop executes, and the start and the stop of its components. Owned by the
/// runner; graph thread.
#pragma once

#include <functional>
#include <memory>
#include <utility>

#include "ordering/plan.hpp"
#include "runner/change_outcome.hpp"

namespace rtcf::executor {

class ActivePlan {
   public:
    Plan& operator*() noexcept { return *plan_; }
    const Plan& operator*() const noexcept { return *plan_; }
    Plan* operator->() noexcept { return plan_.get(); }
    const Plan* operator->() const noexcept { return plan_.get(); }

    /// Replaces the plan. After the loop has adopted the new one.
    /// @return the previous plan
    std::unique_ptr<Plan> replace(std::unique_ptr<Plan> plan) noexcept {
        return std::exchange(plan_, std::move(plan));
    }
    /// Destroys all components. After the end of the loop.
    void clear() { plan_ = std::make_unique<Plan>(); }

    /// Calls the start hooks in order of execution; if one throws, stops the components before.
    /// @param require_go throws if the start has become invalid; called before each hook and at the
    /// end
    void startComponents(const Progress& progress, const std::function<void()>& require_go);
    /// Calls the stop hooks, in reverse order of execution.
    void stopComponents() noexcept;

   private:
    std::unique_ptr<Plan> plan_ = std::make_unique<Plan>();
};

}  // namespace rtcf::executor
