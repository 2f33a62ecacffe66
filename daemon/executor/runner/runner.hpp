/// @file
/// A runner: the graph, its loop, and the one thread that changes them. Every
/// change is a transaction: what is new is constructed and configured beside
/// the running loop, wired and ordered, started, adopted at one cycle boundary;
/// then what left is stopped and cleaned up. A failure at any point leaves all
/// as it was.
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
#include "runner/overrun_report.hpp"
#include "runner/replay.hpp"
#include "runner/told_faults.hpp"
#include "view/runner_view.hpp"
#include "view/settings.hpp"
#include "view/snapshot.hpp"
#include "watch/frame_table.hpp"

namespace rtcf::executor {

enum class RunnerState { Stopped, Running, Faulted, Stuck, Stepping };

/// A state, and how many there have been: of two, the one with the higher number is newer.
struct NumberedState {
    RunnerState state = RunnerState::Stopped;
    std::uint32_t number = 0;
};

/// What came of a change.
struct ChangeOutcome {
    std::uint64_t generation = 0;
    std::vector<std::string> order;     ///< full names
    std::string component;              ///< full name of the one the change was about; may be empty
    std::vector<std::string> notes;     ///< one line each
    std::vector<std::string> degraded;  ///< of start(): what is missing for real time
    std::vector<Difference> differences;  ///< of apply()
    std::uint64_t cycles = 0;             ///< of step(): how many were run
    /// Of replace(): what the new component has of the old one's values.
    std::vector<std::pair<std::string, ParameterValue>> kept;
};

/// An image, and what it leaves out: one line each.
struct ImageOutcome {
    RunnerImage image;
    std::vector<std::string> notes;
};

/// An input that nobody feeds.
struct WritableInput {
    std::string topic;  ///< its mapped name
    const TypeInfo* type;
};

/// Something that happened without a request.
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
    /// Those that were changed, other than by a request.
    std::vector<std::string> parameters = {};  // NOLINT(readability-redundant-member-init): gcc's
    NumberedState state = {};                  ///< when it happened
};

/// Counters and state for a status query; any thread.
struct RunnerPicture {
    RunnerState state = RunnerState::Stopped;
    std::uint32_t state_number = 0;  ///< see NumberedState
    RunnerSettings settings;
    std::vector<std::string> degraded;
    std::string status;
    BridgeStatus bridge;
    bool simulated = false;       ///< the loop follows a simulated clock
    std::uint64_t too_large = 0;  ///< messages lost for their size
};

class Runner final : private RunnerView {
   public:
    using Progress = std::function<void(const std::string&)>;
    using EventConsumer = std::function<void(RunnerEvent)>;

    /// @param name   of the runner
    /// @param log    outlives the runner
    /// @param events called from the graph thread
    /// @param bridge the link to the outside; null = none
    /// @param recorder outlives the runner
    /// @param cpu_claims folder of the claims of CPUs, see CpuClaim; empty = none
    Runner(std::string name, Log& log, EventConsumer events, std::unique_ptr<Bridge> bridge,
           FlightRecorder& recorder, std::string cpu_claims = {});
    /// Stops the loop and lets all components go, in order.
    ~Runner();
    Runner(const Runner&) = delete;
    Runner& operator=(const Runner&) = delete;

    /// Queues work for the graph thread, which calls the functions below. Any thread.
    void post(std::function<void()> job);
    /// Ends the loop at the next boundary without waiting for the graph thread; the stop hooks
    /// follow when it is free. Work that was posted before cannot start the loop any more. Any
    /// thread.
    void requestStop() noexcept { loop_.requestStop(); }

    /// @name By jobs, on the graph thread. All throw Refusal and have then changed nothing.
    /// @{
    void configure(RunnerSettings settings);
    /// Refuses changes that would have more outputs published than so many, from here on.
    void limitTaps(std::size_t most) noexcept { most_taps_ = most; }
    /// Also loads libraries that belong to this user, from here on.
    void trust(uid_t owner) { libraries_.trust(owner); }
    ChangeOutcome start(const Progress& progress);
    ChangeOutcome stop(const Progress& progress);
    /// Runs cycles without real time on a simulated clock, as fast as they go; then pauses.
    /// @param given_up set by any thread to pause at the next boundary; null = nobody does
    ChangeOutcome step(std::uint64_t cycles, const Progress& progress,
                       const std::atomic<bool>* given_up = nullptr);
    /// Runs a piece of a replay. With its beginning all components are made anew, and ROS sees
    /// nothing of the loop until its end.
    ReplayOutcome replay(const ReplayChunk& chunk, const Progress& progress);
    ChangeOutcome load(ComponentDefinition definition, const std::string& library,
                       const Progress& progress);
    ChangeOutcome unload(const std::vector<std::string>& names, const Progress& progress);
    /// @param reset parameters that `definition` does not name get their defaults, else those of
    ///              the old component that fit
    ChangeOutcome replace(const std::string& name, ComponentDefinition definition,
                          const std::string& library, bool reset, const Progress& progress);
    /// Makes the graph what is wanted, in one transaction; or only tells what it would take.
    ChangeOutcome apply(const std::vector<WantedComponent>& wanted, bool dry_run,
                        const Progress& progress);
    ChangeOutcome setBreaks(const std::vector<std::pair<std::string, std::string>>& ports,
                            bool broken);
    ChangeOutcome setParameters(const std::string& name,
                                const std::vector<std::pair<std::string, ParameterValue>>& batch);
    /// Takes a component's declared state back to its initial values, at one boundary.
    ChangeOutcome reset(const std::string& name);
    /// The object itself; it is not to be touched while the loop runs.
    const Component& component(const std::string& name) const {
        return plan_->graph.get(name).instance->component();
    }
    /// Changes values of a component's declared state, numbers and bools, of a loop that does not
    /// run.
    ChangeOutcome setStates(const std::string& name,
                            const std::vector<std::pair<std::string, ParameterValue>>& batch);
    /// An input that can be written. @throws Refusal also if a component or ROS feeds it
    WritableInput writableInput(const std::string& name, const std::string& port) const;
    /// Gives such an input a value at the next boundary. @param message serialised, of its ROS type
    ChangeOutcome writeInput(const std::string& name, const std::string& port,
                             const std::string& message);
    /// All that the next cycle depends on, of one boundary.
    ImageOutcome takeImage();
    /// Makes all of it what an image says, at one boundary: parameters, declared state, the values
    /// of connections. A loop that does not run is paused, as after step().
    ChangeOutcome restore(const RunnerImage& image, const Progress& progress);
    /// Values of a component's declared state, as text. Empty if the loop reaches no boundary in
    /// time.
    std::vector<std::string> states(const std::string& name);
    /// Values of a component's ports, inputs first. Empty if the loop reaches no boundary in time.
    std::vector<Probe::Value> probe(const std::string& name);
    /// Has cycles keep the values of a selection for a watch. @param watch a number of its own
    void watch(std::uint64_t watch, PortSelection selection);
    /// Ends that; one that is not known has ended.
    void endWatch(std::uint64_t watch);
    /// Settings to start from.
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
    const FrameMemory& frameMemory() const noexcept { return frame_memory_; }
    /// What has come since the last call of how frames look: each table holds for the frames in its
    /// ring, up to those of the next one. Its last owner is to let go of it on the graph thread.
    std::vector<std::shared_ptr<const FrameTable>> takeFrameTables();
    /// Is called, on the graph thread, when there are so many frames that cycles which run as fast
    /// as they go wait for somebody to take them.
    void onFramesWaiting(std::function<void()> tell);
    /// See Loop. One thread, whichever.
    void holdFigures(bool held) noexcept { loop_.holdFigures(held); }
    /// Name of the hook that the graph thread is in, and since when; empty = none.
    std::pair<std::string, std::int64_t> activity() const;
    /// @}

   private:
    struct Change {
        Graph graph;
        std::string loading;            // new component, for advice on loops
        std::set<std::string> changed;  // components to picture anew
        std::vector<std::shared_ptr<Instance>> arriving;
        std::vector<std::shared_ptr<Instance>> leaving;
        std::vector<StagedValue*> values;
        std::vector<HandOver> hand_overs;
        std::vector<StateCopy> copies;
        Restoration* restoration = nullptr;
        std::vector<std::string> notes;  // of what is handed over
        std::int64_t period_ns = 0;
    };

    std::uint64_t logRecordsDropped() const override { return log_.dropped(); }
    bool popCycle(CycleRecord& record) override { return loop_.popRecord(record); }

    struct Job {
        std::function<void()> work;
        std::uint64_t stops;  // that had been requested when it was posted
    };

    void threadMain();
    void guarded(const char* what, const std::function<void()>& work) noexcept;
    void tell(const RunnerEvent& event) noexcept;
    void tick();
    void setState(RunnerState state) noexcept;
    void requireNoStop() const;
    void noticeEnd();
    void requireNoLoop();
    void requireNoReplay() const;
    void requireThreadLocals(const Library& library);
    std::string whatDoesNotReturn() const;
    /// Hands it to the loop. @throws Refusal if that does not take it
    void adoptAtBoundary(Adoption& adoption);
    void loopEnded();
    void noteLoopFault();
    void noteComponentFaults();
    void noteFaultsOf(Instance& instance);
    void noteOverruns(bool last);
    void noteSizes();
    /// A change of parameters that the bridge asks for.
    void changeByBridge(const std::string& component, const ParameterBatch& batch,
                        const std::function<void(const std::string&)>& done);
    std::shared_ptr<const BridgeTable> bridgeTable() const;
    void serveBridge(bool served);
    void tuneSpin();
    const GraphNode* nodeOf(const Component* component) const noexcept;
    void beginStepping(std::int64_t stamp_ns = 0);
    void pause(const Progress& progress);
    /// Bytes that may be copied at one boundary.
    std::size_t mostAtOnce() const;
    void requireSmall(std::size_t bytes, const char* what) const;
    void endStepping();
    ReplayOutcome beginReplay(const ReplayChunk& chunk, const Progress& progress);
    void renewComponents(const Progress& progress);
    std::shared_ptr<Instance> makeInstance(ComponentDefinition definition,
                                           const std::string& library, const Progress& progress,
                                           bool configure = true);
    /// Works a difference into a change. @param look without configuring what is new
    void addDifference(Change& change, const Difference& difference, const Progress& progress,
                       bool look);
    /// Wires, starts, adopts; then stops and cleans up what left.
    /// @return notes on what was handed over @throws Refusal and others; nothing has changed then
    std::vector<std::string> adopt(Change change, const Progress& progress);
    /// Has a component take another's place, with its state.
    void handOver(Change& change, const Instance& previous, const Instance& successor) const;
    /// Of a change that the loop has: makes it known.
    void adopted(const Change& change);
    /// Has the loop fill the frames that the watches want, of the present plan.
    void renewFrames();
    std::shared_ptr<const FrameTable> framesOf(const Plan& plan);
    void publishFrames(std::shared_ptr<const FrameTable> frames) noexcept;
    std::uint64_t stepWatched(std::uint64_t cycles, const std::atomic<bool>* given_up);
    void awaitReaders();
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
    void note(std::string activity);

    const std::string name_;
    Log& log_;
    EventConsumer events_;
    FlightRecorder& recorder_;
    LibraryStore libraries_;
    Loop loop_;
    StallMonitor stall_monitor_;
    std::unique_ptr<Bridge> bridge_;
    bool discards_cycles_ = true;  // nobody else takes the cycle records
    SizeWatch size_watch_;

    // Graph thread only.
    RunnerSettings settings_;
    std::unique_ptr<Plan> plan_ = std::make_unique<Plan>();
    std::set<std::string> written_;  // mapped names with inputs that writeInput() feeds
    std::size_t most_taps_ = SIZE_MAX;
    RunnerState state_ = RunnerState::Stopped;
    std::uint64_t job_stops_ = 0;       // Job::stops of the present one
    RealtimeProblems memory_problems_;  // as found at the start of the present loop
    std::vector<std::string> degraded_;
    std::string status_;
    OverrunReport overrun_report_;
    std::uint64_t told_faults_ = 0;  // LoopFigures::faults at the last look
    ToldFaults told_not_finite_;
    std::int64_t tuned_spin_ns_ = -1;  // by tuneSpin(); -1 = not yet
    std::unique_ptr<Replay> replay_;   // while one is under way
    bool bridge_served_ = true;        // not while a replay has the ports to itself
    std::shared_ptr<SimulatedClock> clock_ = std::make_shared<SimulatedClock>();
    bool simulated_ = false;        // the loop follows clock_
    HistogramSnapshot tuned_from_;  // wake-up latency at the last tuneSpin()
    std::int64_t tuned_at_ns_ = 0;
    std::int64_t sizes_due_ns_ = 0;
    FrameMemory frame_memory_;
    Watches watches_;
    std::shared_ptr<const FrameTable> frames_;  // that the loop fills; null before the first

    // Published for queries.
    std::atomic<NumberedState> numbered_state_;
    mutable std::mutex published_mutex_;
    std::shared_ptr<const GraphSnapshot> snapshot_ = std::make_shared<GraphSnapshot>();
    RunnerPicture picture_;
    std::vector<std::shared_ptr<const FrameTable>> new_frames_;
    std::function<void()> frames_waiting_;
    std::string activity_;
    std::int64_t activity_since_ns_ = 0;

    // Jobs.
    std::mutex jobs_mutex_;
    std::condition_variable jobs_changed_;
    std::deque<Job> jobs_;
    std::atomic<bool> ending_{false};
    std::thread thread_;
};

}  // namespace rtcf::executor
