/// @file
/// A runner: the graph, its loop, and the graph thread, which alone changes them; and a thread that
/// counts the loop's cycles. The runner owns the threads, the jobs, and the following objects. An
/// object uses only those above it:
///
///     Publication, CycleStatistics           data for queries
///     ActivePlan, FrameKeeper, BridgeLink    plan and frames of the loop; link to the outside
///     LoopBoundary                           changes at a cycle boundary
///     LoopControl                            start, stop and supervision of the loop
///     ComponentLoader, Transactions          changes of the graph
///     ValueChanges, OfflineRun, Snapshots    parameters and state; steps and replays; snapshots
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "bridge/bridge.hpp"
#include "faults/flight_recorder.hpp"
#include "graph/definition.hpp"
#include "graph/difference.hpp"
#include "logging/log.hpp"
#include "loop/cycle_statistics.hpp"
#include "loop/loop.hpp"
#include "runner/active_plan.hpp"
#include "runner/bridge_link.hpp"
#include "runner/change_outcome.hpp"
#include "runner/component_loader.hpp"
#include "runner/frame_keeper.hpp"
#include "runner/loop_boundary.hpp"
#include "runner/loop_control.hpp"
#include "runner/offline_run.hpp"
#include "runner/publication.hpp"
#include "runner/runner_event.hpp"
#include "runner/snapshots.hpp"
#include "runner/transactions.hpp"
#include "runner/value_changes.hpp"
#include "snapshot/snapshot.hpp"
#include "view/runner_view.hpp"
#include "view/settings.hpp"

namespace rtcf::executor {

class Runner final : private RunnerView {
   public:
    using EventConsumer = std::function<void(RunnerEvent)>;

    /// @param name   name of the runner
    /// @param log    outlives the runner
    /// @param events called from the graph thread
    /// @param bridge link to the outside; null = none
    /// @param recorder outlives the runner
    /// @param cpu_claims folder of the CPU claims, see CpuClaim; empty = none
    Runner(std::string name, Log& log, EventConsumer events, std::unique_ptr<Bridge> bridge,
           FlightRecorder& recorder, std::string cpu_claims = {});
    /// Stops the loop and destroys all components, in order.
    ~Runner();
    Runner(const Runner&) = delete;
    Runner& operator=(const Runner&) = delete;

    /// Queues work for the graph thread, which calls the functions below. Any thread.
    void post(std::function<void()> job);
    /// Stops the loop at the next boundary without waiting for the graph thread, which calls the
    /// stop hooks later. Jobs posted before cannot start the loop any more. Any thread.
    void requestStop() noexcept { loop_.requestStop(); }

    /// @name Graph thread, from jobs
    /// If a function throws Error, it has changed nothing.
    /// @{
    void configure(RunnerSettings settings);
    /// Limits the number of published outputs; later changes beyond the limit are rejected.
    void limitTaps(std::size_t most) noexcept { transactions_.limitTaps(most); }
    /// Trusts libraries of this user from here on.
    void trust(uid_t owner) { loader_.trust(owner); }
    ChangeOutcome start(const Progress& progress);
    ChangeOutcome stop(const Progress& progress);
    /// See OfflineRun.
    ChangeOutcome step(std::uint64_t cycles, const Progress& progress,
                       const std::atomic<bool>* given_up = nullptr) {
        return offline_.step(cycles, progress, given_up);
    }
    ReplayOutcome replay(const ReplayChunk& chunk, const Progress& progress) {
        return offline_.replay(chunk, progress);
    }
    /// See Transactions. Each job that changes the graph ends with cleanUpLeft().
    void cleanUpLeft() noexcept { transactions_.cleanUpLeft(); }
    ChangeOutcome load(ComponentDefinition definition, const std::string& library,
                       const Progress& progress) {
        return transactions_.load(std::move(definition), library, progress);
    }
    ChangeOutcome unload(const std::vector<std::string>& names, const Progress& progress) {
        return transactions_.unload(names, progress);
    }
    ChangeOutcome replace(const std::string& name, ComponentDefinition definition,
                          const std::string& library, bool reset, const Progress& progress) {
        return transactions_.replace(name, std::move(definition), library, reset, progress);
    }
    ChangeOutcome apply(const std::vector<WantedComponent>& wanted, bool dry_run,
                        const Progress& progress) {
        return transactions_.apply(wanted, dry_run, progress);
    }
    ChangeOutcome setBreaks(const std::vector<std::pair<std::string, std::string>>& ports,
                            bool broken) {
        return transactions_.setBreaks(ports, broken);
    }
    void watch(std::uint64_t watch, Watch wanted, bool allow_missing) {
        transactions_.watch(watch, std::move(wanted), allow_missing);
    }
    void endWatch(std::uint64_t watch) { transactions_.endWatch(watch); }
    /// See ValueChanges.
    ChangeOutcome setParameters(const std::string& name,
                                const std::vector<std::pair<std::string, ParameterValue>>& batch) {
        return values_.setParameters(name, batch);
    }
    ChangeOutcome reset(const std::string& name) { return values_.reset(name); }
    ChangeOutcome setStates(const std::string& name,
                            const std::vector<std::pair<std::string, ParameterValue>>& batch) {
        return values_.setStates(name, batch);
    }
    WritableInput writableInput(const std::string& name, const std::string& port) const {
        return values_.writableInput(name, port);
    }
    ChangeOutcome writeInput(const std::string& name, const std::string& port,
                             const std::string& message) {
        return values_.writeInput(name, port, message);
    }
    /// See Snapshots.
    SnapshotOutcome takeSnapshot() { return snapshots_.take(); }
    ChangeOutcome restore(const Snapshot& snapshot, const Progress& progress) {
        return snapshots_.restore(snapshot, progress);
    }
    /// The component's object. The caller must not use it while the loop runs.
    const Component& component(const std::string& name) const {
        return plan_->graph.get(name).instance->component();
    }
    /// Values of a component's declared state, as text. Empty if the loop reaches no boundary in
    /// time.
    std::vector<std::string> states(const std::string& name);
    /// Values of a component's ports, inputs first. Empty if the loop reaches no boundary in time.
    std::vector<Probe::Value> probe(const std::string& name);
    /// The present settings.
    const RunnerSettings& settings() const noexcept { return settings_; }
    /// @}

    /// @name Any thread, at any time
    /// @{
    const std::string& name() const noexcept override { return name_; }
    std::shared_ptr<const GraphView> graph() const override { return publication_.graph(); }
    RunnerStatus status() const override { return publication_.status(); }
    NumberedState numberedState() const noexcept { return publication_.state(); }
    const Loop& loop() const noexcept override { return loop_; }
    const FlightRecorder& recorder() const noexcept { return recorder_; }
    const FrameMemory& frameMemory() const noexcept { return frames_.memory(); }
    /// See FrameKeeper.
    std::vector<std::shared_ptr<const FrameTable>> takeFrameTables() {
        return frames_.takePublished();
    }
    void onReadersAwaited(std::function<void()> callback) {
        frames_.onReadersAwaited(std::move(callback));
    }
    CycleStatistics& cycleStatistics() override { return statistics_; }
    /// @}

   private:
    struct Job {
        std::function<void()> work;
        std::uint64_t stops = 0;  // Loop::stops() when the job was posted
    };

    std::uint64_t logRecordsDropped() const override { return log_.dropped(); }
    bool nextCycle(CycleRecord& cycle) override { return frames_.nextCycle(cycle); }
    void skipCycles() override { frames_.skipCycles(); }
    std::uint64_t cyclesLost() const override { return frames_.cyclesLost(); }

    void threadMain();
    void countCycles();
    void tick();
    void reportEvent(const RunnerEvent& event) noexcept;
    /// Changes parameters at the request of the bridge.
    void changeByBridge(const std::string& component, const ParameterBatch& batch,
                        BatchPolicy policy, const std::function<void(const std::string&)>& done);

    const std::string name_;
    Log& log_;
    EventConsumer events_;
    FlightRecorder& recorder_;
    std::atomic<bool> ending_{false};
    RunnerSettings settings_;  // graph thread only

    Loop loop_;
    BridgeLink bridge_;
    ActivePlan plan_;
    Publication publication_;
    CycleStatistics statistics_{loop_.statistics()};
    FrameKeeper frames_;
    LoopBoundary boundary_;
    LoopControl control_;
    ComponentLoader loader_;
    Transactions transactions_;
    ValueChanges values_;
    OfflineRun offline_;
    Snapshots snapshots_;

    // Jobs.
    std::mutex jobs_mutex_;
    std::condition_variable jobs_changed_;
    std::deque<Job> jobs_;
    std::thread thread_;

    // Counting of cycles.
    std::mutex counting_mutex_;
    std::condition_variable counting_ends_;
    std::thread counting_thread_;
};

}  // namespace rtcf::executor
