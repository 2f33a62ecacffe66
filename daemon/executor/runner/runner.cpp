#include "runner/runner.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

#include "faults/crash_handler.hpp"
#include "refusal.hpp"

namespace rtcf::executor {

namespace {

constexpr auto kBridgePatience = std::chrono::seconds(2);
constexpr auto kTick = std::chrono::milliseconds(20);
constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::int64_t kProbeTimeout = 100'000'000;

template <typename T>
bool contains(const std::vector<T>& items, const T& item) {
    return std::find(items.begin(), items.end(), item) != items.end();
}

}  // namespace

Runner::Runner(std::string name, Log& log, EventConsumer events, std::unique_ptr<Bridge> bridge,
               FlightRecorder& recorder)
    : name_(std::move(name)),
      log_(log),
      events_([this, events = std::move(events)](RunnerEvent event) {
          event.state = numberedState();
          events(std::move(event));
      }),
      recorder_(recorder),
      loop_(log, recorder),
      stall_monitor_(loop_),
      bridge_(std::move(bridge)),
      size_watch_(name_,
                  [this](const std::string& line) { log_.write(LogLevel::Warn, {}, line); }) {
    if (bridge_) {
        bridge_->serveParameters([this](const std::string& component, ParameterBatch batch,
                                        std::function<void(const std::string&)> done) {
            post([this, component, batch = std::move(batch), done = std::move(done)] {
                changeByBridge(component, batch, done);
            });
        });
    }
    validate(settings_);
    stall_monitor_.setTimeout(settings_.stall_timeout_ns);
    publishPicture();
    if (bridge_) discards_cycles_ = !bridge_->attach(*this);
    thread_ = std::thread([this] { threadMain(); });
}

Runner::~Runner() {
    {
        const std::lock_guard<std::mutex> lock(jobs_mutex_);
        ending_ = true;
    }
    loop_.requestStop();
    jobs_changed_.notify_all();
    thread_.join();
}

void Runner::post(std::function<void()> job) {
    {
        const std::lock_guard<std::mutex> lock(jobs_mutex_);
        jobs_.push_back({std::move(job), loop_.stops()});
    }
    jobs_changed_.notify_all();
}

void Runner::threadMain() {
    const CrashContext crash_context(ThreadRole::Graph);
    pthread_setname_np(pthread_self(), "rtcf-graph");
    std::unique_lock<std::mutex> lock(jobs_mutex_);
    while (!ending_) {  // what still waits then is not begun any more
        jobs_changed_.wait_for(lock, kTick, [this] { return ending_ || !jobs_.empty(); });
        Job job{};
        if (!jobs_.empty()) {
            job = std::move(jobs_.front());
            jobs_.pop_front();
        }
        lock.unlock();
        job_stops_ = job.stops;
        if (job.work) job.work();
        note({});
        tick();
        lock.lock();
    }
    lock.unlock();
    loop_.requestStop();
    loop_.join(INT64_MAX);
    if (state_ == RunnerState::Stepping) loop_.endStepping();
    stopAll();
    if (bridge_) bridge_->setTable(std::make_shared<BridgeTable>());
    // Components may reach for ROS until they are gone.
    plan_ = std::make_unique<Plan>();
    bridge_.reset();
    log_.drain();
}

// What has to be done now and then: a loop that ended by itself, clocks, counters.
void Runner::tick() {
    noticeEnd();
    if (loop_.joinable()) {
        loop_.refreshWallClock();
        tuneSpin();
    }
    noteComponentFaults();
    noteOverruns(false);
    noteClockJumps();
    noteSizes();
    CycleRecord record{};
    while (discards_cycles_ && loop_.popRecord(record)) {
    }
    publishPicture();
}

// A loop may end by itself at any time, also while a change waits for its next boundary.
void Runner::noticeEnd() {
    if (state_ == RunnerState::Running && !loop_.running()) loopEnded();
}

void Runner::loopEnded() {
    loop_.join(INT64_MAX);
    simulate(false);
    noteOverruns(true);
    noteLoopFault();
    stopAll();
    publish({loop_.fault().component_name.data()});
}

void Runner::setState(RunnerState state) noexcept {
    state_ = state;
    numbered_state_.store({state, numbered_state_.load().number + 1});
}

// A stop is final: no work that was posted before it begins cycles.
void Runner::requireNoStop() const {
    if (loop_.stops() == job_stops_) return;
    throw Refusal(
        RefusalKind::FailedPrecondition,
        fmt::format("the loop of {} is not started: a stop was asked for after the start", name_));
}

void Runner::noteLoopFault() {
    const LoopFault& fault = loop_.fault();
    setState(fault.kind == LoopFault::Kind::None ? RunnerState::Stopped : RunnerState::Faulted);
    if (state_ == RunnerState::Faulted) {
        RunnerEvent event{RunnerEvent::Kind::LoopEnded, {}, {}, fault.iteration};
        if (fault.kind == LoopFault::Kind::Overruns) {
            event.message = fmt::format("loop stopped in iteration {}: more than {} overruns",
                                        fault.iteration, settings_.loop.max_overruns);
        }
        if (fault.component != nullptr) {
            event.component = fault.component_name.data();
            const std::string what = fault.kind == LoopFault::Kind::NotFinite
                                         ? fmt::format("output {} is not finite", fault.text.data())
                                         : fmt::format("update() threw: {}", fault.text.data());
            event.message = fmt::format("loop stopped in iteration {}: {}: {}", fault.iteration,
                                        event.component, what);
            // It may have been unloaded at the boundary at which the loop ended.
            if (const GraphNode* node = nodeOf(fault.component); node != nullptr) {
                node->instance->setFault(fmt::format("iteration {}: {}", fault.iteration, what));
            }
        }
        status_ = event.message;
        events_(event);
    }
}

const GraphNode* Runner::nodeOf(const Component* component) const noexcept {
    for (const GraphNode& node : plan_->graph.nodes()) {
        if (&node.instance->component() == component) return &node;
    }
    return nullptr;
}

// Components that failed while the loop went on: each kind said once, until the next start.
void Runner::noteComponentFaults() {
    const std::uint64_t count = loop_.figures().faults.value();
    if (std::exchange(told_faults_, count) == count) return;
    for (const GraphNode& node : plan_->graph.nodes()) noteFaultsOf(*node.instance);
}

void Runner::noteFaultsOf(Instance& instance) {
    ComponentFaults& faults = instance.figures()->faults;
    const auto say = [&](const ComponentFault* fault, const char* text) {
        if (fault == nullptr) return;
        const std::string what = fmt::vformat(text, fmt::make_format_args(fault->text.data()));
        instance.setFault(fmt::format("iteration {}: {}", fault->iteration, what));
        events_({RunnerEvent::Kind::ComponentFailed,
                 fmt::format("{}: iteration {}: {}", instance.fullName(), fault->iteration, what),
                 instance.fullName(), fault->iteration});
        publish({instance.fullName()});
    };
    say(faults.not_finite.take(), "output {} is not finite: readers keep its last value");
    say(faults.taken_out.take(), "update() threw: {}; taken out, the loop goes on");
}

void Runner::noteOverruns(bool last) {
    std::string line = overrun_report_.take(loop_, plan_->graph, last);
    if (line.empty()) return;
    if (lacks_realtime_ && settings_.loop.max_overruns != 0)
        line += "; max_overruns ends no loop that runs degraded";
    events_({RunnerEvent::Kind::Overruns, std::move(line), {}, loop_.figures().iteration.load()});
}

void Runner::noteSizes() {
    const std::int64_t now = monotonicNow();
    if (now < sizes_due_ns_) return;
    sizes_due_ns_ = now + kSecond / 2;
    size_watch_.look(plan_->taps, plan_->injectors, settings_.bridge.largest_message, now);
}

void Runner::changeByBridge(const std::string& component, const ParameterBatch& batch,
                            const std::function<void(const std::string&)>& done) {
    std::string refusal;
    try {
        setParameters(component, batch);
        RunnerEvent event{RunnerEvent::Kind::ParametersChanged, {}, component, 0};
        for (const auto& [name, value] : batch) event.parameters.push_back(name);
        events_(event);
    } catch (const Refusal& error) {
        refusal = error.what();
        log_.write(LogLevel::Warn, component, "a change asked for by ROS is refused: " + refusal);
    }
    done(refusal);
}

std::shared_ptr<const BridgeTable> Runner::bridgeTable() const {
    auto table = std::make_shared<BridgeTable>(plan_->bridgeTable());
    for (const auto& component : snapshot_->components) {
        if (!component->parameters.empty()) table->parameters.push_back(component);
    }
    return table;
}

// spin = auto: as long as 99 of 100 wake-ups of the last second were late, at most a tenth of the
// period.
void Runner::tuneSpin() {
    if (!settings_.spin_auto || monotonicNow() - tuned_at_ns_ < kSecond) return;
    const HistogramSnapshot now = loop_.figures().wake_up.snapshot();
    const DistributionSummary late = summarize(difference(now, tuned_from_), 1.0);
    tuned_from_ = now;
    tuned_at_ns_ = monotonicNow();
    if (late.count == 0) return;
    tuned_spin_ns_ = std::min(static_cast<std::int64_t>(late.p99), settings_.loop.period_ns / 10);
    loop_.setSpin(tuned_spin_ns_);
}

MappingFilter Runner::filter() const {
    return {NamePattern("whitelist", settings_.whitelist),
            NamePattern("blacklist", settings_.blacklist)};
}

std::int64_t Runner::adoptionTimeout() const noexcept {
    return kSecond + 10 * settings_.loop.period_ns;
}

void Runner::configure(RunnerSettings settings) {
    validate(settings);
    const RunnerSettings previous = std::exchange(settings_, std::move(settings));
    try {
        Change change;
        change.graph = plan_->graph;
        if (settings_.loop.period_ns != previous.loop.period_ns)
            change.period_ns = settings_.loop.period_ns;
        adopt(std::move(change), [](const std::string&) {});
    } catch (const Refusal&) {
        settings_ = previous;
        throw;
    }
    tuned_spin_ns_ = -1;
    if (loop_.joinable()) {
        for (const RealtimeProblem& problem : loop_.retune(loopSettings())) {
            if (!contains(degraded_, problem.text)) degraded_.push_back(problem.text);
        }
    }
    stall_monitor_.setTimeout(settings_.stall_timeout_ns);
    log_.setLimit(settings_.log_limit);
    if (bridge_) bridge_->configure(settings_.bridge);
    publishPicture();
}

ChangeOutcome Runner::start(const Progress& progress) {
    noticeEnd();
    if (loop_.running()) return outcome();
    if (state_ == RunnerState::Stepping) endStepping();
    startAll(progress);
    try {
        simulate(wantsSimulation(progress));
        progress("starting the loop");
        degraded_.clear();
        for (RealtimeProblem& problem : lockAndStart())
            degraded_.push_back(std::move(problem.text));
    } catch (const Refusal&) {
        simulate(false);
        stopAll();
        throw;
    }
    setState(RunnerState::Running);
    status_.clear();
    publish();
    for (const std::string& problem : degraded_) {
        events_({RunnerEvent::Kind::Degraded, "degraded real time: " + problem, {}, 0});
    }
    ChangeOutcome result = outcome();
    for (const std::string& problem : degraded_)
        result.notes.push_back("degraded real time: " + problem);
    return result;
}

// A bridge that has just been told where its peers are is given a moment to ask them.
bool Runner::wantsSimulation(const Progress& progress) {
    if (!bridge_ || !settings_.bridge.enabled || settings_.sim_time == SimTime::Never) return false;
    if (settings_.sim_time == SimTime::Always) return true;
    progress("asking the ROS master for /use_sim_time");
    const auto until = std::chrono::steady_clock::now() + kBridgePatience;
    while (std::chrono::steady_clock::now() < until && !ending_) {
        requireNoStop();
        const BridgeStatus status = bridge_->status();
        if (status.simulated_time) return *status.simulated_time;
        if (!status.connected && !status.problem.empty()) return false;  // there is none
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return false;
}

void Runner::simulate(bool simulated) {
    if (simulated) clock_->reset(settings_.max_clock_jump_ns);
    simulated_ = simulated;
    settings_.loop.clock = simulated ? clock_ : nullptr;
    settings_.loop.realtime.wanted = !simulated;
    if (!bridge_) return;
    for (const auto& injector : plan_->bridgeTable().inputs) injector->setQueueing(simulated);
    bridge_->setClock(settings_.loop.clock);
    if (!simulated) return;
    // Whoever starts the loop and then the simulation is to lose no tick.
    const auto until = std::chrono::steady_clock::now() + kBridgePatience;
    while (!bridge_->status().follows_clock && std::chrono::steady_clock::now() < until && !ending_)
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
}

void Runner::noteClockJumps() {
    while (const std::optional<ClockJump> jump = clock_->takeJump()) {
        const double to = static_cast<double>(jump->to_ns) / 1e9;
        std::string message = fmt::format("the simulated clock begins at {:.9f} s", to);
        if (jump->from_ns) {
            message = fmt::format(
                "the simulated clock went from {:.9f} s to {:.9f} s: time goes on "
                "from there with one cycle",
                static_cast<double>(*jump->from_ns) / 1e9, to);
        }
        events_({RunnerEvent::Kind::Clock,
                 message,
                 {},
                 loop_.figures().iteration.load(std::memory_order_relaxed)});
    }
}

RealtimeProblems Runner::lockAndStart() {
    lacks_realtime_ = false;
    if (simulated_) return loop_.start(loopSettings(), job_stops_);
    RealtimeProblems problems = lockMemory(settings_.loop.realtime);
    for (RealtimeProblem& problem : checkScheduling(settings_.loop.realtime))
        problems.push_back(std::move(problem));
    for (const RealtimeProblem& problem : problems) {
        if (!problem.essential) continue;
        lacks_realtime_ = true;
        if (!settings_.realtime_required) continue;
        throw Refusal(RefusalKind::FailedPrecondition,
                      fmt::format("no real time: {}; or let it run degraded: rtcfctl runner set {} "
                                  "--realtime preferred",
                                  problem.text, name_));
    }
    tuned_spin_ns_ = -1;
    for (RealtimeProblem& problem : loop_.start(loopSettings(), job_stops_))
        problems.push_back(std::move(problem));
    return problems;
}

// As chosen; but where there is no real time, cycles are late that the graph is not to blame for.
LoopSettings Runner::loopSettings() const {
    LoopSettings settings = settings_.loop;
    if (lacks_realtime_) settings.max_overruns = 0;
    return settings;
}

ChangeOutcome Runner::stop(const Progress& progress) {
    if (loop_.joinable()) {
        progress("stopping the loop");
        if (!loop_.stopRequested())
            loop_.requestStop();  // it must not void a start that came since
        if (!loop_.join(adoptionTimeout())) {
            throw Refusal(RefusalKind::Unavailable,
                          fmt::format("the loop of {} does not reach the end of its cycle: {}",
                                      name_, whatDoesNotReturn()));
        }
        loopEnded();
    } else if (state_ == RunnerState::Stepping) {
        endStepping();
    }
    return outcome();
}

// Other cycles than the loop's are run only while it does not run.
void Runner::requireNoLoop() {
    noticeEnd();
    if (!loop_.joinable()) return;
    throw Refusal(
        RefusalKind::FailedPrecondition,
        fmt::format("the loop of {0} runs in real time: stop it first: rtcfctl -r {0} stop",
                    name_));
}

ChangeOutcome Runner::step(std::uint64_t cycles, const Progress& progress) {
    constexpr std::uint64_t kChunk = 10000;  // cycles between reports
    requireNoLoop();
    if (state_ != RunnerState::Stepping) {
        startAll(progress);
        beginStepping();
        setState(RunnerState::Stepping);
        status_.clear();
        publish();
    }
    std::uint64_t left = cycles;
    while (left > 0) {
        const std::uint64_t wanted = std::min(left, kChunk);
        const std::uint64_t done = loop_.step(wanted);
        left -= done;
        log_.drain();
        note({});  // a long run is not a hook that hangs
        if (done < wanted || ending_) break;
        if (left > 0) progress(fmt::format("{} of {} cycles", cycles - left, cycles));
    }
    if (loop_.fault().kind != LoopFault::Kind::None || loop_.stopRequested()) endStepping();
    ChangeOutcome result = outcome();
    result.cycles = cycles - left;
    return result;
}

ReplayOutcome Runner::replay(const ReplayChunk& chunk, const Progress& progress) {
    ReplayOutcome outcome;
    if (chunk.begin) {
        outcome = beginReplay(chunk, progress);
    } else if (!replay_) {
        throw Refusal(RefusalKind::FailedPrecondition,
                      fmt::format("no replay of {} is under way: it was stopped", name_));
    } else {
        try {
            outcome = replay_->run(chunk);
        } catch (const Refusal&) {
            endStepping();
            throw;
        }
    }
    log_.drain();
    note({});
    const bool ended = loop_.fault().kind != LoopFault::Kind::None || loop_.stopRequested();
    if ((chunk.end && !outcome.more) || ended) endStepping();
    if (ended) throw Refusal(RefusalKind::FailedPrecondition, status_);
    return outcome;
}

// Of components that have started.
void Runner::beginStepping(std::int64_t stamp_ns) {
    try {
        loop_.beginStepping(settings_.loop, job_stops_, stamp_ns);
    } catch (const Refusal&) {
        stopAll();
        throw;
    }
}

ReplayOutcome Runner::beginReplay(const ReplayChunk& chunk, const Progress& progress) {
    requireNoLoop();
    if (state_ == RunnerState::Stepping) endStepping();
    Replay::check(plan_->bridgeTable(), chunk.topics);
    renewComponents(progress);
    if (bridge_) bridge_->setTable(std::make_shared<BridgeTable>());
    try {
        startAll(progress);
        beginStepping(chunk.start_ns);
    } catch (const Refusal&) {
        if (bridge_) bridge_->setTable(bridgeTable());
        throw;
    }
    setState(RunnerState::Stepping);
    status_.clear();
    replay_ = std::make_unique<Replay>(plan_->bridgeTable(), loop_, chunk.start_ns);
    publish();
    ReplayOutcome outcome;
    replay_->describe(outcome);
    return outcome;
}

// The same components with the same parameters, but nothing that they or their inputs remember.
void Runner::renewComponents(const Progress& progress) {
    Change renewed;
    Change previous;
    previous.graph = plan_->graph;
    for (const GraphNode& node : plan_->graph.nodes()) {
        const Instance& old = *node.instance;
        ComponentDefinition definition = old.definition();
        definition.parameters.clear();
        const auto& parameters = old.component().parameters();
        for (std::size_t i = 0; i < parameters.size(); ++i) {
            definition.parameters.emplace_back(parameters[i]->declaration().name,
                                               old.parameterValues()[i]);
        }
        auto instance = makeInstance(std::move(definition), old.library().path(), progress);
        if (old.hasPhase()) instance->setPhase(old.phase());
        renewed.graph.add({instance, node.breaks});
        renewed.leaving.push_back(node.instance);
    }
    adopt({}, progress);  // so that no connection's value stays
    try {
        adopt(std::move(renewed), progress);
    } catch (const Refusal&) {
        adopt(std::move(previous), progress);
        throw;
    }
}

void Runner::endStepping() {
    loop_.endStepping();
    if (replay_) {
        replay_->discardOutputs();  // ROS sees nothing of them
        replay_.reset();
        if (bridge_) bridge_->setTable(bridgeTable());
    }
    noteLoopFault();
    stopAll();
    publish({loop_.fault().component_name.data()});
}

void Runner::startAll(const Progress& progress) {
    std::vector<Instance*> started;
    try {
        for (const std::size_t index : plan_->wiring.order) {
            Instance& instance = *plan_->graph.nodes()[index].instance;
            progress("starting " + instance.fullName());
            requireNoStop();
            note(instance.fullName() + ".start");
            started.push_back(&instance);
            instance.setFault({});
            instance.start();
        }
        requireNoStop();
    } catch (const Refusal&) {
        for (auto instance = started.rbegin(); instance != started.rend(); ++instance)
            (*instance)->stop();
        throw;
    }
}

void Runner::stopAll() noexcept {
    // Against the order of execution: a component may rely on what it reads as long as it runs.
    for (auto index = plan_->wiring.order.rbegin(); index != plan_->wiring.order.rend(); ++index) {
        Instance& instance = *plan_->graph.nodes()[*index].instance;
        note(instance.fullName() + ".stop");
        instance.stop();
    }
}

std::shared_ptr<Instance> Runner::makeInstance(ComponentDefinition definition,
                                               const std::string& library, const Progress& progress,
                                               bool configure) {
    const std::string full_name = definition.fullName();
    progress("loading " + full_name);
    note(full_name + ".constructor");
    const std::shared_ptr<const Library> code = libraries_.open(library);
    auto instance =
        std::make_shared<Instance>(std::move(definition), code, name_, loop_.clock(), log_,
                                   recorder_, bridge_ ? bridge_->hooks() : nullptr);
    if (!configure) {
        instance->freezePorts();
        return instance;
    }
    progress("configuring " + full_name);
    note(full_name + ".configure");
    instance->configure();
    return instance;
}

void Runner::requireNoReplay() const {
    if (!replay_) return;
    throw Refusal(RefusalKind::FailedPrecondition,
                  fmt::format("a replay of {0} is under way: wait for its end, or stop it: "
                              "rtcfctl -r {0} stop",
                              name_));
}

std::string Runner::whatDoesNotReturn() const {
    const std::string activity = recorder_.realtimeActivity();
    return (activity.empty() ? "a component" : activity + "()") + " does not return";
}

void Runner::adoptAtBoundary(Adoption& adoption) {
    note({});
    if (loop_.adopt(adoption, adoptionTimeout())) return;
    throw Refusal(RefusalKind::Unavailable,
                  fmt::format("the loop of {} reaches no cycle boundary: {}; nothing has changed",
                              name_, whatDoesNotReturn()));
}

void Runner::adopt(Change change, const Progress& progress) {
    noticeEnd();
    requireNoReplay();
    const Graph graph = change.graph;
    Wiring wiring = wire(graph, filter(), change.loading);
    checkTaps(wiring);
    Adoption adoption;
    std::unique_ptr<Plan> plan = buildPlan(graph, std::move(wiring), *plan_, settings_.frequency_hz,
                                           adoption, settings_.bridge);
    adoption.values = std::move(change.values);
    adoption.hand_overs = std::move(change.hand_overs);
    adoption.period_ns = change.period_ns;
    if (loop_.running() || state_ == RunnerState::Stepping) {
        for (const auto& instance : change.arriving) {
            progress("starting " + instance->fullName());
            note(instance->fullName() + ".start");
            instance->start();
        }
    }
    progress("adopting the change");
    adoptAtBoundary(adoption);
    plan->noteKept(adoption, *plan_);
    std::swap(plan_, plan);
    if (simulated_) {
        for (const auto& injector : plan_->bridgeTable().inputs) injector->setQueueing(true);
    }
    publish(change.changed);
    if (bridge_) bridge_->setTable(bridgeTable());
    if (!adoption.values.empty()) {
        for (const GraphNode& node : plan_->graph.nodes()) node.instance->releaseStaged();
    }
    // Out of the loop since its last boundary: what left may take its time.
    for (const auto& instance : change.leaving) {
        noteFaultsOf(*instance);
        note(instance->fullName() + ".stop");
        instance->stop();
        note(instance->fullName() + ".cleanup");
        instance->cleanup();
    }
    noticeEnd();
}

void Runner::checkTaps(const Wiring& wiring) const {
    std::size_t taps = 0;
    for (const auto& [name, connection] : wiring.connections)
        taps += connection.published ? 1 + connection.others.size() : 0;
    // What is above a limit that was lowered may stay, and shrink.
    if (taps <= most_taps_ || taps <= plan_->taps.size()) return;
    throw Refusal(RefusalKind::ResourceExhausted,
                  fmt::format("{} published outputs (taps) are more than the {} allowed: let the "
                              "whitelist match fewer, or raise taps under [limits] in rtcfd's "
                              "settings",
                              taps, most_taps_));
}

ChangeOutcome Runner::load(ComponentDefinition definition, const std::string& library,
                           const Progress& progress) {
    plan_->graph.requireFree(definition.fullName());
    const std::set<std::string> breaks = definition.breaks;
    const std::shared_ptr<Instance> instance =
        makeInstance(std::move(definition), library, progress);
    Change change;
    change.graph = plan_->graph;
    change.graph.add({instance, breaks});
    change.loading = instance->fullName();
    change.arriving = {instance};
    adopt(std::move(change), progress);
    return outcomeOf(*instance);
}

ChangeOutcome Runner::outcomeOf(const Instance& arrived) const {
    ChangeOutcome result = outcome(arrived.fullName());
    for (const std::string& remap : arrived.uselessRemaps()) {
        result.notes.push_back(
            fmt::format("remap {} names no port of {}", remap, arrived.fullName()));
    }
    result.kept = arrived.keptParameters();
    for (const std::string& line : arrived.lostParameters()) result.notes.push_back(line);
    addRemarks(result, arrived.fullName());
    return result;
}

ChangeOutcome Runner::unload(const std::vector<std::string>& names, const Progress& progress) {
    if (names.empty())
        throw Refusal(RefusalKind::InvalidArgument, "no component to unload is named");
    Change change;
    change.graph = plan_->graph;
    for (const std::string& name : names) {
        change.leaving.push_back(change.graph.get(name).instance);
        change.graph.remove(name);
    }
    progress("unloading");
    adopt(std::move(change), progress);
    return outcome(names.size() == 1 ? names[0] : "");
}

ChangeOutcome Runner::replace(const std::string& name, ComponentDefinition definition,
                              const std::string& library, bool reset, const Progress& progress) {
    const GraphNode old = plan_->graph.get(name);
    if (definition.fullName() != name) plan_->graph.requireFree(definition.fullName());
    if (!reset) {
        const auto& declared = old.instance->component().parameters();
        for (std::size_t i = 0; i < declared.size(); ++i) {
            const ParameterDeclaration& declaration = declared[i]->declaration();
            const ParameterValue& value = old.instance->parameterValues()[i];
            definition.inherited.push_back(
                {declaration.name, value, value != declaration.default_value});
        }
    }
    const std::set<std::string> breaks = definition.breaks;
    const std::shared_ptr<Instance> instance =
        makeInstance(std::move(definition), library, progress);
    Change change;
    change.graph = plan_->graph;
    change.graph.replace(name, {instance, breaks});
    change.loading = instance->fullName();
    change.arriving = {instance};
    change.leaving = {old.instance};
    change.hand_overs = {{&instance->component(), &old.instance->component()}};
    adopt(std::move(change), progress);
    return outcomeOf(*instance);
}

void Runner::addRemarks(ChangeOutcome& outcome, const std::string& component) const {
    for (std::string& line : remarks(plan_->graph, plan_->wiring, filter(), component))
        outcome.notes.push_back(std::move(line));
}

ChangeOutcome Runner::apply(const std::vector<WantedComponent>& wanted, bool dry_run,
                            const Progress& progress) {
    std::vector<Difference> differences = compare(plan_->graph, wanted);
    std::vector<std::pair<std::shared_ptr<Instance>, std::vector<ParameterValue>>> previous;
    for (const GraphNode& node : plan_->graph.nodes()) {
        previous.emplace_back(node.instance, node.instance->parameterValues());
    }
    const auto restoreParameters = [&] {
        for (auto& [instance, values] : previous) instance->restoreParameterValues(values);
    };
    try {
        Change change;
        change.graph = plan_->graph;
        for (const Difference& difference : differences)
            addDifference(change, difference, progress, dry_run);
        if (dry_run) {
            (void)wire(change.graph, filter(), {});
            restoreParameters();
        } else if (!differences.empty()) {
            adopt(std::move(change), progress);
        }
    } catch (const Refusal&) {
        restoreParameters();
        throw;
    }
    ChangeOutcome result = outcome();
    result.differences = std::move(differences);
    for (Difference& difference : result.differences) {
        difference.wanted = nullptr;
        if (!dry_run) addRemarks(result, difference.component);
    }
    return result;
}

void Runner::addDifference(Change& change, const Difference& difference, const Progress& progress,
                           bool look) {
    const std::string& name = difference.component;
    switch (difference.kind) {
        case Difference::Kind::Unload:
            change.leaving.push_back(change.graph.get(name).instance);
            change.graph.remove(name);
            return;
        case Difference::Kind::Breaks:
            change.graph.setBreaks(name, difference.wanted->definition.breaks);
            return;
        case Difference::Kind::Parameters: {
            const auto staged =
                change.graph.get(name).instance->stageParameters(difference.parameters);
            change.values.insert(change.values.end(), staged.begin(), staged.end());
            change.changed.insert(name);
            return;
        }
        case Difference::Kind::Load:
        case Difference::Kind::Replace:
            break;
    }
    const ComponentDefinition& definition = difference.wanted->definition;
    const std::shared_ptr<Instance> instance =
        makeInstance(definition, difference.wanted->library, progress, !look);
    change.arriving.push_back(instance);
    if (difference.kind == Difference::Kind::Load) {
        change.graph.add({instance, definition.breaks});
        return;
    }
    const std::shared_ptr<Instance> old = change.graph.get(name).instance;
    change.graph.replace(name, {instance, definition.breaks});
    change.leaving.push_back(old);
    change.hand_overs.push_back({&instance->component(), &old->component()});
}

ChangeOutcome Runner::setBreaks(const std::vector<std::pair<std::string, std::string>>& ports,
                                bool broken) {
    if (ports.empty()) throw Refusal(RefusalKind::InvalidArgument, "no input is named");
    Change change;
    change.graph = plan_->graph;
    for (const auto& [component, port] : ports) change.graph.setBreak(component, port, broken);
    adopt(std::move(change), [](const std::string&) {});
    return outcome(ports[0].first);
}

ChangeOutcome Runner::setParameters(
    const std::string& name, const std::vector<std::pair<std::string, ParameterValue>>& batch) {
    Instance& instance = *plan_->graph.get(name).instance;
    const std::vector<ParameterValue> previous = instance.parameterValues();
    noticeEnd();
    requireNoReplay();
    // Values alone: the schedule stays as it is.
    Adoption adoption;
    adoption.values = instance.stageParameters(batch);
    try {
        adoptAtBoundary(adoption);
    } catch (const Refusal&) {
        instance.restoreParameterValues(previous);
        throw;
    }
    instance.releaseStaged();
    ++plan_->schedule.generation;  // which the cycle does not look at
    publish({name});
    if (bridge_) bridge_->setTable(bridgeTable());
    noticeEnd();
    return outcome(name);
}

std::vector<Probe::Value> Runner::probe(const std::string& name) {
    const Instance& instance = *plan_->graph.get(name).instance;
    loop_.adoptInjections();
    Probe probe;
    std::size_t count = 0;
    for (const InputBase* input : instance.component().inputs()) count = probe.add(*input) + 1;
    for (const OutputBase* output : instance.component().outputs()) count = probe.add(*output) + 1;
    std::vector<Probe::Value> values;
    if (!loop_.probe(probe, kProbeTimeout + 2 * settings_.loop.period_ns)) return values;
    for (std::size_t i = 0; i < count; ++i) values.push_back(probe.value(i));
    return values;
}

ChangeOutcome Runner::outcome(std::string component) const {
    ChangeOutcome result;
    result.generation = plan_->schedule.generation;
    for (const std::size_t index : plan_->wiring.order) {
        result.order.push_back(plan_->graph.nodes()[index].instance->fullName());
    }
    result.component = std::move(component);
    return result;
}

void Runner::publish(const std::set<std::string>& changed) {
    const std::shared_ptr<const GraphSnapshot> next = takeSnapshot(*plan_, *snapshot(), changed);
    {
        const std::lock_guard<std::mutex> lock(published_mutex_);
        snapshot_ = next;
    }
    publishPicture();
}

void Runner::publishPicture() {
    RunnerPicture next{state_,     numbered_state_.load().number,
                       settings_,  degraded_,
                       status_,    bridge_ ? bridge_->status() : BridgeStatus{},
                       simulated_, size_watch_.total()};
    if (settings_.spin_auto && tuned_spin_ns_ >= 0) next.settings.loop.spin_ns = tuned_spin_ns_;
    const std::lock_guard<std::mutex> lock(published_mutex_);
    picture_ = std::move(next);
}

std::shared_ptr<const GraphSnapshot> Runner::snapshot() const {
    const std::lock_guard<std::mutex> lock(published_mutex_);
    return snapshot_;
}

RunnerPicture Runner::picture() const {
    const std::lock_guard<std::mutex> lock(published_mutex_);
    return picture_;
}

void Runner::note(std::string activity) {
    const std::lock_guard<std::mutex> lock(published_mutex_);
    activity_ = std::move(activity);
    activity_since_ns_ = monotonicNow();
}

std::pair<std::string, std::int64_t> Runner::activity() const {
    const std::lock_guard<std::mutex> lock(published_mutex_);
    return {activity_, activity_since_ns_};
}

}  // namespace rtcf::executor
