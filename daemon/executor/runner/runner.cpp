#include "runner/runner.hpp"

#include <fmt/format.h>

#include "common/refusal.hpp"
#include "faults/crash_handler.hpp"
#include "logging/log_errors.hpp"

namespace rtcf::executor {

namespace {

constexpr auto kTick = std::chrono::milliseconds(20);
constexpr std::int64_t kProbeTimeout = 100'000'000;

}  // namespace

Runner::Runner(std::string name, Log& log, EventConsumer events, std::unique_ptr<Bridge> bridge,
               FlightRecorder& recorder, std::string cpu_claims)
    : name_(std::move(name)),
      log_(log),
      events_([this, events = std::move(events)](RunnerEvent event) {
          event.state = numberedState();
          events(std::move(event));
      }),
      recorder_(recorder),
      loop_(log, recorder, std::move(cpu_claims)),
      stall_monitor_(loop_),
      bridge_(std::move(bridge)),
      size_watch_(name_, [this](const std::string& line) { log_.write(LogLevel::Warn, {}, line); }),
      frames_(loop_, log) {
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
    while (!ending_) {  // jobs that still wait at the end are discarded
        jobs_changed_.wait_for(lock, kTick, [this] { return ending_ || !jobs_.empty(); });
        Job job{};
        if (!jobs_.empty()) {
            job = std::move(jobs_.front());
            jobs_.pop_front();
        }
        lock.unlock();
        job_stops_ = job.stops;
        if (job.work) logErrors(log_, "a change", job.work);
        activity_.end();
        logErrors(log_, "supervising the loop", [this] { tick(); });
        lock.lock();
    }
    lock.unlock();
    loop_.requestStop();
    loop_.join(INT64_MAX);
    if (state_ == RunnerState::Stepping) loop_.endStepping();
    stopAll();
    logErrors(log_, "reporting the end", [this] {  // to clients of the bridge
        if (state_ != RunnerState::Faulted) setState(RunnerState::Stopped);
        publishPicture();
    });
    if (bridge_) bridge_->setTable(std::make_shared<BridgeTable>());
    // Components may use ROS until they are destroyed.
    plan_ = std::make_unique<Plan>();
    bridge_.reset();
    log_.drain();
}

void Runner::tell(const RunnerEvent& event) noexcept {
    logErrors(log_, "reporting an event", [&] { events_(event); });
}

// Periodic work: a loop that ended by itself, clocks, counters.
void Runner::tick() {
    noticeEnd();
    if (loop_.joinable()) {
        loop_.refreshWallClock();
        if (settings_.spin_auto) spin_tuner_.tune(loop_, settings_.loop.period_ns);
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

// Handles a loop that has ended by itself, which is possible at any time, even while a change waits
// for the next boundary.
void Runner::noticeEnd() {
    if (state_ == RunnerState::Running && !loop_.running()) loopEnded();
}

void Runner::changeByBridge(const std::string& component, const ParameterBatch& batch,
                            const std::function<void(const std::string&)>& done) {
    std::string refusal;
    try {
        setParameters(component, batch);
        RunnerEvent event{RunnerEvent::Kind::ParametersChanged, {}, component, 0};
        for (const auto& [name, value] : batch) event.parameters.push_back(name);
        tell(event);
    } catch (const std::exception& error) {
        refusal = error.what();
        log_.write(LogLevel::Warn, component, "a change requested by ROS was rejected: " + refusal);
    }
    done(refusal);
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

std::vector<std::string> Runner::states(const std::string& name) {
    StatePicture picture(plan_->graph.get(name).instance->component());
    Adoption look;
    look.copies = picture.copies();
    // A query must not delay the loop.
    if (look.copies.empty() || bytesOf(look.copies) > mostAtOnce()) return {};
    if (!loop_.adopt(look, kProbeTimeout + 2 * settings_.loop.period_ns)) return {};
    return picture.texts();
}

std::shared_ptr<const BridgeTable> Runner::bridgeTable() const {
    if (!bridge_served_) return std::make_shared<BridgeTable>();
    auto table = std::make_shared<BridgeTable>(plan_->bridgeTable());
    for (const auto& component : snapshot_->components) {
        if (!component->parameters.empty()) table->parameters.push_back(component);
    }
    return table;
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
    if (settings_.spin_auto && spin_tuner_.spin()) next.settings.loop.spin_ns = *spin_tuner_.spin();
    const std::lock_guard<std::mutex> lock(published_mutex_);
    picture_ = std::move(next);
}

void Runner::setState(RunnerState state) noexcept {
    state_ = state;
    numbered_state_.store({state, numbered_state_.load().number + 1});
}

std::shared_ptr<const GraphSnapshot> Runner::snapshot() const {
    const std::lock_guard<std::mutex> lock(published_mutex_);
    return snapshot_;
}

RunnerPicture Runner::picture() const {
    const std::lock_guard<std::mutex> lock(published_mutex_);
    return picture_;
}

}  // namespace rtcf::executor
