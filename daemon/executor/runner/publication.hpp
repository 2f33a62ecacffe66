/// @file
/// The graph view, the status and the state of a runner, as published for queries. Owned by the
/// runner. The graph thread writes it; any thread reads it, without waiting for a hook.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <utility>

#include "view/graph_view.hpp"
#include "view/runner_status.hpp"

namespace rtcf::executor {

class Publication {
   public:
    /// @name Graph thread
    /// @{
    void setGraph(std::shared_ptr<const GraphView> graph) {
        const std::lock_guard<std::mutex> lock(mutex_);
        graph_ = std::move(graph);
    }
    /// Sets the status; its state is the present one.
    void setStatus(RunnerStatus status) {
        const NumberedState state = state_.load();
        status.state = state.state;
        status.state_number = state.number;
        const std::lock_guard<std::mutex> lock(mutex_);
        status_ = std::move(status);
    }
    /// Sets the state, with the next number.
    void setState(RunnerState state) noexcept { state_.store({state, state_.load().number + 1}); }
    /// @}

    /// @name Any thread
    /// @{
    std::shared_ptr<const GraphView> graph() const {
        const std::lock_guard<std::mutex> lock(mutex_);
        return graph_;
    }
    RunnerStatus status() const {
        const std::lock_guard<std::mutex> lock(mutex_);
        return status_;
    }
    NumberedState state() const noexcept { return state_.load(); }
    /// @}

   private:
    std::atomic<NumberedState> state_;
    mutable std::mutex mutex_;  // protects the following
    std::shared_ptr<const GraphView> graph_ = std::make_shared<GraphView>();
    RunnerStatus status_;
};

}  // namespace rtcf::executor
