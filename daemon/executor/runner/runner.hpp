/// @file
/// A runner: the graph, its loop, and the graph thread, which alone changes them. Every change is a
/// transaction: new components are constructed and configured beside the running loop; the new
/// graph is wired and ordered; new components are started; the loop adopts the change at one cycle
/// boundary; then leaving components are stopped and cleaned up. A failure before the adoption
/// leaves everything as it was.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "bridge/size_watch.hpp"
#include "faults/flight_recorder.hpp"
#include "graph/definition.hpp"
#include "graph/difference.hpp"
#include "image/image.hpp"
#include "logging/log.hpp"
#include "loop/loop.hpp"
#include "loop/simulated_clock.hpp"
#include "loop/stall_monitor.hpp"
#include "ordering/plan.hpp"
#include "plugins/library.hpp"
#include "runner/frame_keeper.hpp"
#include "runner/hook_activity.hpp"
#include "runner/overrun_report.hpp"
#include "runner/replay.hpp"
#include "runner/spin_tuner.hpp"
#include "runner/told_faults.hpp"
#include "view/runner_view.hpp"
#include "view/settings.hpp"
#include "view/snapshot.hpp"
#include "watch/frame_table.hpp"

namespace rtcf::executor {

enum class RunnerState { Stopped, Running, Faulted, Stuck, Stepping };

/// A state with its number; of two states, the one with the higher number is newer.
struct NumberedState {
    RunnerState state = RunnerState::Stopped;
    std::uint32_t number = 0;
};

/// Result of a change.
struct ChangeOutcome {
    std::uint64_t generation = 0;
    std::vector<std::string> order;       ///< full names, in order of execution
    std::string component;                ///< full name of the changed component; may be empty
    std::vector<std::string> notes;       ///< one line each
    std::vector<std::string> degraded;    ///< start() only: missing prerequisites of real time
    std::vector<Difference> differences;  ///< apply() only
    std::uint64_t cycles = 0;             ///< step() only: cycles run
    /// replace() only: parameter values kept from the old component.
    std::vector<std::pair<std::string, ParameterValue>> kept;
};

/// A snapshot, and notes on omitted values, one line each.
struct ImageOutcome {
    RunnerImage image;
    std::vector<std::string> notes;
};

/// An input without a writer.
struct WritableInput {
    std::string topic;  ///< mapped name
    const TypeInfo* type;
};

/// An event without a request.
struct RunnerEvent {
    enum class Kind {
        LoopEnded,
        Degraded,
        Ros,
        ComponentFailed,
        Overruns,
        Clock,
        ParametersChanged
    };
    Kind kind;
    std::string message;
    std::string component;
    std::uint64_t iteration = 0;
    /// ParametersChanged only: names of the parameters.
    std::vector<std::string> parameters = {};  // NOLINT(readability-redundant-member-init): gcc's
    NumberedState state = {};                  ///< state at the time of the event
};

/// Status of a runner, for queries. Any thread.
struct RunnerPicture {
    RunnerState state = RunnerState::Stopped;
    std::uint32_t state_number = 0;  ///< see NumberedState
    RunnerSettings settings;
    std::vector<std::string> degraded;
    std::string status;
    BridgeStatus bridge;
    bool simulated = false;       ///< the loop follows a simulated clock
    std::uint64_t too_large = 0;  ///< messages lost because of their size
};

class Runner final : private RunnerView {
   public:
    using Progress = std::function<void(const std::string&)>;
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
    /// If a function throws Refusal, it has changed nothing.
    /// @{
    void configure(RunnerSettings settings);
    /// Limits the number of published outputs; later changes beyond the limit are rejected.
    void limitTaps(std::size_t most) noexcept { most_taps_ = most; }
    /// Trusts libraries of this user from here on.
    void trust(uid_t owner) { libraries_.trust(owner); }
    ChangeOutcome start(const Progress& progress);
    ChangeOutcome stop(const Progress& progress);
    /// Runs cycles on a simulated clock, as fast as possible; then pauses.
    /// @param given_up set by any thread to pause at the next boundary; null = never
    ChangeOutcome step(std::uint64_t cycles, const Progress& progress,
                       const std::atomic<bool>* given_up = nullptr);
    /// Runs a part of a replay. The first part recreates all components, and disconnects ROS until
    /// the end of the replay.
    ReplayOutcome replay(const ReplayChunk& chunk, const Progress& progress);
    ChangeOutcome load(ComponentDefinition definition, const std::string& library,
                       const Progress& progress);
    ChangeOutcome unload(const std::vector<std::string>& names, const Progress& progress);
    /// @param reset true = parameters that `definition` does not set get their defaults; false =
    /// they keep valid values of the old component
    ChangeOutcome replace(const std::string& name, ComponentDefinition definition,
                          const std::string& library, bool reset, const Progress& progress);
    /// Changes the graph to the wanted one, in one transaction.
    /// @param dry_run only computes the differences
    ChangeOutcome apply(const std::vector<WantedComponent>& wanted, bool dry_run,
                        const Progress& progress);
    ChangeOutcome setBreaks(const std::vector<std::pair<std::string, std::string>>& ports,
                            bool broken);
    ChangeOutcome setParameters(const std::string& name,
                                const std::vector<std::pair<std::string, ParameterValue>>& batch);
    /// Resets a component's declared state to its initial values, at one boundary.
    ChangeOutcome reset(const std::string& name);
    /// The component's object. The caller must not use it while the loop runs.
    const Component& component(const std::string& name) const {
        return plan_->graph.get(name).instance->component();
    }
    /// Sets declared state of a component (numbers and bools). Only while the loop does not run.
    ChangeOutcome setStates(const std::string& name,
                            const std::vector<std::pair<std::string, ParameterValue>>& batch);
    /// The input, if it can be written.
    /// @throws Refusal also if a component or ROS writes it
    WritableInput writableInput(const std::string& name, const std::string& port) const;
    /// Writes a value to such an input at the next boundary.
    /// @param message serialised message of the input's ROS type
    ChangeOutcome writeInput(const std::string& name, const std::string& port,
                             const std::string& message);
    /// Takes a snapshot at one boundary.
    ImageOutcome takeImage();
    /// Restores a snapshot at one boundary: parameters, declared state, and the values of
    /// connections. If the loop does not run, it is then paused, as after step().
    ChangeOutcome restore(const RunnerImage& image, const Progress& progress);
    /// Values of a component's declared state, as text. Empty if the loop reaches no boundary in
    /// time.
    std::vector<std::string> states(const std::string& name);
    /// Values of a component's ports, inputs first. Empty if the loop reaches no boundary in time.
    std::vector<Probe::Value> probe(const std::string& name);
    /// Keeps the values of a watch in frames.
    /// @param watch unique number of the watch
    /// @param allow_missing true = its selection may match nothing yet
    void watch(std::uint64_t watch, Watch wanted, bool allow_missing);
    /// Ends a watch; does nothing if the number is unknown.
    void endWatch(std::uint64_t watch);
    /// The present settings.
    const RunnerSettings& settings() const noexcept { return settings_; }
    /// @}

    /// @name Any thread, at any time
    /// @{
    const std::string& name() const noexcept override { return name_; }
    std::shared_ptr<const GraphSnapshot> snapshot() const override;
    RunnerPicture picture() const override;
    NumberedState numberedState() const noexcept { return numbered_state_.load(); }
    const Loop& loop() const noexcept override { return loop_; }
    const FlightRecorder& recorder() const noexcept { return recorder_; }
    const FrameMemory& frameMemory() const noexcept { return frames_.memory(); }
    /// See FrameKeeper.
    std::vector<std::shared_ptr<const FrameTable>> takeFrameTables() {
        return frames_.takePublished();
    }
    void onReadersAwaited(std::function<void()> tell) { frames_.onReadersAwaited(std::move(tell)); }
    /// See Loop. One thread only.
    void holdFigures(bool held) noexcept { loop_.holdFigures(held); }
    /// Hook that the graph thread is running, and since when (CLOCK_MONOTONIC, ns); empty = none.
    std::pair<std::string, std::int64_t> activity() const { return activity_.present(); }
    /// @}

   private:
    struct Change {
        Graph graph;
        std::string loading;            // new component, for advice on loops
        std::set<std::string> changed;  // components to copy into the graph view again
        std::vector<std::shared_ptr<Instance>> arriving;
        std::vector<std::shared_ptr<Instance>> leaving;
        std::vector<StagedValue*> values;
        std::vector<HandOver> hand_overs;
        std::vector<StateCopy> copies;
        Restoration* restoration = nullptr;
        std::vector<std::string> notes;  // notes on the hand-over of state
        std::int64_t period_ns = 0;
    };

    std::uint64_t logRecordsDropped() const override { return log_.dropped(); }
    bool popCycle(CycleRecord& record) override { return loop_.popRecord(record); }

    struct Job {
        std::function<void()> work;
        std::uint64_t stops;  // Loop::stops() when the job was posted
    };

    void threadMain();
    void tell(const RunnerEvent& event) noexcept;
    void tick();
    void setState(RunnerState state) noexcept;
    void requireNoStop() const;
    void noticeEnd();
    void requireNoLoop();
    void requireNoReplay() const;
    void requireThreadLocals(const Library& library);
    std::string whatDoesNotReturn() const;
    /// Applies the adoption.
    /// @throws Refusal if the loop does not apply it in time
    void adoptAtBoundary(Adoption& adoption);
    void loopEnded();
    void noteLoopFault();
    void noteComponentFaults();
    void noteFaultsOf(Instance& instance);
    void noteOverruns(bool last);
    void noteSizes();
    /// Changes parameters at the request of the bridge.
    void changeByBridge(const std::string& component, const ParameterBatch& batch,
                        const std::function<void(const std::string&)>& done);
    std::shared_ptr<const BridgeTable> bridgeTable() const;
    void serveBridge(bool served);
    const GraphNode* nodeOf(const Component* component) const noexcept;
    void beginStepping(std::int64_t stamp_ns = 0);
    void pause(const Progress& progress);
    /// Most bytes to copy at one boundary.
    std::size_t mostAtOnce() const;
    void requireSmall(std::size_t bytes, const char* what) const;
    void endStepping();
    ReplayOutcome beginReplay(const ReplayChunk& chunk, const Progress& progress);
    void renewComponents(const Progress& progress);
    std::shared_ptr<Instance> makeInstance(ComponentDefinition definition,
                                           const std::string& library, const Progress& progress,
                                           bool configure = true);
    /// Adds a difference to a change.
    /// @param look true = does not configure new components
    void addDifference(Change& change, const Difference& difference, const Progress& progress,
                       bool look);
    /// Wires, starts and adopts a change; then stops and cleans up leaving components.
    /// @return notes on the hand-over of state
    /// @throws Refusal and others; nothing has changed then
    std::vector<std::string> adopt(Change change, const Progress& progress);
    /// Plans the hand-over of state to a replacement.
    void handOver(Change& change, const Instance& previous, const Instance& successor) const;
    /// Publishes a change that the loop has adopted.
    void adopted(const Change& change);
    /// Replaces the frames after a change of the watches.
    void renewFrames();
    void startAll(const Progress& progress);
    void stopAll() noexcept;
    ChangeOutcome outcome(std::string component = {}) const;
    ChangeOutcome outcomeOf(const Instance& arrived) const;
    void addRemarks(ChangeOutcome& outcome, const std::set<std::string>& components) const;
    RealtimeProblems lockAndStart();
    std::uint32_t mostOverruns() const noexcept;
    LoopSettings loopSettings() const;
    bool wantsSimulation(const Progress& progress);
    void simulate(bool simulated);
    void noteClockJumps();
    MappingFilter filter() const;
    void publish(const std::set<std::string>& changed = {});
    void publishPicture();
    std::int64_t adoptionTimeout() const noexcept;
    void checkTaps(const Wiring& wiring) const;

    const std::string name_;
    Log& log_;
    EventConsumer events_;
    FlightRecorder& recorder_;
    LibraryStore libraries_;
    Loop loop_;
    StallMonitor stall_monitor_;
    std::unique_ptr<Bridge> bridge_;
    bool discards_cycles_ = true;  // no bridge consumes the cycle records
    SizeWatch size_watch_;

    // Graph thread only.
    RunnerSettings settings_;
    std::unique_ptr<Plan> plan_ = std::make_unique<Plan>();
    std::set<std::string> written_;  // mapped names of inputs written by writeInput()
    std::size_t most_taps_ = SIZE_MAX;
    RunnerState state_ = RunnerState::Stopped;
    std::uint64_t job_stops_ = 0;       // Job::stops of the present job
    RealtimeProblems memory_problems_;  // result of lockMemory() at the last start
    std::vector<std::string> degraded_;
    std::string status_;
    OverrunReport overrun_report_;
    std::uint64_t told_faults_ = 0;  // LoopFigures::faults at the last check
    ToldFaults told_not_finite_;
    SpinTuner spin_tuner_;
    std::unique_ptr<Replay> replay_;  // null = no replay
    bool bridge_served_ = true;       // false during a replay, which uses the ports alone
    std::shared_ptr<SimulatedClock> clock_ = std::make_shared<SimulatedClock>();
    bool simulated_ = false;  // the loop follows clock_
    std::int64_t sizes_due_ns_ = 0;
    FrameKeeper frames_;

    // Published for queries.
    std::atomic<NumberedState> numbered_state_;
    mutable std::mutex published_mutex_;
    std::shared_ptr<const GraphSnapshot> snapshot_ = std::make_shared<GraphSnapshot>();
    RunnerPicture picture_;
    HookActivity activity_;

    // Jobs.
    std::mutex jobs_mutex_;
    std::condition_variable jobs_changed_;
    std::deque<Job> jobs_;
    std::atomic<bool> ending_{false};
    std::thread thread_;
};

}  // namespace rtcf::executor
