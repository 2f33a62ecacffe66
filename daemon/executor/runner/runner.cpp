#include "runner/runner.hpp"

#include <pthread.h>

#include <algorithm>
#include <chrono>

#include "common/c_locale.hpp"
#include "common/error.hpp"
#include "common/thrown.hpp"
#include "faults/crash_handler.hpp"
#include "logging/log_errors.hpp"

namespace rtcf::executor {

namespace {

constexpr auto kTick = std::chrono::milliseconds(20);
constexpr std::int64_t kProbeTimeout = 100'000'000;
// Time between two counts of cycles: so long that they fill only a part of the ring, even if a
// loop without real time runs faster than its frequency.
constexpr std::chrono::nanoseconds kShortestCount = std::chrono::milliseconds(1);
constexpr std::chrono::nanoseconds kLongestCount = std::chrono::milliseconds(64);
constexpr double kMuch = 0.3;
constexpr double kLittle = 0.1;

// True if a change of parameters failed because of a value, not because of the state of the loop.
bool isOfAValue(const std::exception& error) {
    const auto* const known = dynamic_cast<const Error*>(&error);
    return known != nullptr &&
           (known->kind() == ErrorKind::InvalidArgument || known->kind() == ErrorKind::HookFailed);
}

}  // namespace

Runner::Runner(std::string name, Log& log, EventConsumer events, std::unique_ptr<Bridge> bridge,
               FlightRecorder& recorder, std::string cpu_claims)
    : name_(std::move(name)),
      log_(log),
      events_(std::move(events)),
      recorder_(recorder),
      loop_(log, recorder, std::move(cpu_claims)),
      bridge_(std::move(bridge)),
      frames_(loop_, statistics_, log),
      boundary_(name_, settings_, loop_, recorder),
      control_(
          name_, settings_, loop_, boundary_, plan_, publication_, bridge_, log,
          [this](const RunnerEvent& event) { reportEvent(event); }, ending_),
      loader_(name_, loop_, control_, bridge_, log, recorder),
      transactions_(name_, settings_, loop_, boundary_, control_, plan_, frames_, publication_,
                    bridge_, loader_, log),
      values_(name_, loop_, boundary_, control_, plan_, publication_, bridge_, transactions_, log),
      offline_(name_, loop_, control_, plan_, frames_, publication_, bridge_, transactions_, log),
      snapshots_(name_, settings_, loop_, boundary_, control_, plan_, transactions_, offline_) {
    validate(settings_);
    transactions_.adoptFrames();
    control_.publishStatus();
    bridge_.attach(*this, [this](const std::string& component, ParameterBatch batch,
                                 BatchPolicy policy, std::function<void(const std::string&)> done) {
        post([this, component, batch = std::move(batch), policy, done = std::move(done)] {
            changeByBridge(component, batch, policy, done);
        });
    });
    thread_ = std::thread([this] { threadMain(); });
    counting_thread_ = std::thread([this] { countCycles(); });
}

Runner::~Runner() {
    {
        const std::lock_guard<std::mutex> lock(jobs_mutex_);
        ending_ = true;
    }
    loop_.requestStop();
    jobs_changed_.notify_all();
    thread_.join();
    {
        const std::lock_guard<std::mutex> lock(counting_mutex_);
        counting_ends_.notify_all();
    }
    counting_thread_.join();
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
    useCLocale();
    std::unique_lock<std::mutex> lock(jobs_mutex_);
    while (!ending_) {  // jobs that still wait at the end are discarded
        jobs_changed_.wait_for(lock, kTick, [this] { return ending_ || !jobs_.empty(); });
        Job job;
        if (!jobs_.empty()) {
            job = std::move(jobs_.front());
            jobs_.pop_front();
        }
        lock.unlock();
        control_.beginJob(job.stops);
        if (job.work) logErrors(log_, "a change", job.work);
        cleanUpLeft();
        recorder_.leaveHook();
        logErrors(log_, "supervising the loop", [this] { tick(); });
        lock.lock();
    }
    lock.unlock();
    control_.finish();
    bridge_.close();
    // Components may use ROS until they are destroyed.
    plan_.clear();
    bridge_.reset();
    log_.drain();
}

void Runner::tick() {
    control_.tick();
    control_.publishStatus();
}

void Runner::countCycles() {
    const CrashContext crash_context(ThreadRole::Other);
    pthread_setname_np(pthread_self(), "rtcf-counts");
    std::chrono::nanoseconds pause = kShortestCount;
    std::unique_lock<std::mutex> lock(counting_mutex_);
    while (!ending_) {
        const double filled = statistics_.count();
        if (filled > kMuch) pause = std::max(pause / 2, kShortestCount);
        if (filled < kLittle) pause = std::min(pause * 2, kLongestCount);
        const std::chrono::duration<double, std::nano> full(
            static_cast<double>(statistics_.capacity()) *
            static_cast<double>(loop_.clock().period_ns));
        const auto most = std::chrono::duration_cast<std::chrono::nanoseconds>(kMuch * full);
        pause = std::max(std::min(pause, most), kShortestCount);
        counting_ends_.wait_for(lock, pause);
    }
}

void Runner::reportEvent(const RunnerEvent& event) noexcept {
    logErrors(log_, "reporting an event", [&] {
        RunnerEvent numbered = event;
        numbered.state = numberedState();
        events_(std::move(numbered));
    });
}

void Runner::configure(RunnerSettings settings) {
    validate(settings);
    const RunnerSettings previous = std::exchange(settings_, std::move(settings));
    const std::int64_t period_ns = settings_.loop.period_ns;
    try {
        transactions_.applySettings(period_ns == previous.loop.period_ns ? 0 : period_ns);
    } catch (...) {
        settings_ = previous;
        throw;
    }
    control_.applySettings();
    log_.setLimit(settings_.log_limit);
    bridge_.configure(settings_.bridge);
    control_.publishStatus();
}

ChangeOutcome Runner::start(const Progress& progress) {
    control_.noticeEnd();
    if (loop_.running()) return outcomeWith(*plan_);
    offline_.end();
    std::vector<std::string> degraded = control_.start(progress);
    ChangeOutcome result = outcomeWith(*plan_);
    result.degraded = std::move(degraded);
    return result;
}

ChangeOutcome Runner::stop(const Progress& progress) {
    if (loop_.joinable())
        control_.stop(progress);
    else
        offline_.end();
    return outcomeWith(*plan_);
}

void Runner::changeByBridge(const std::string& component, const ParameterBatch& batch,
                            BatchPolicy policy,
                            const std::function<void(const std::string&)>& done) {
    std::string message;
    try {
        setParameters(component, batch);
        RunnerEvent event{RunnerEvent::Kind::ParametersChanged, {}, component, 0};
        for (const auto& [name, value] : batch) event.parameters.push_back(name);
        reportEvent(event);
    } catch (const std::exception& error) {
        if (policy == BatchPolicy::Each && batch.size() > 1 && isOfAValue(error)) {
            for (const auto& value : batch) {
                changeByBridge(component, {value}, policy, [&message](const std::string& rejected) {
                    if (!rejected.empty()) message = rejected;
                });
            }
            done(message);
            return;
        }
        message = textOf(error);
        log_.write(LogLevel::Warn, component, "a change requested by ROS was rejected: " + message);
    }
    done(message);
}

std::vector<Probe::Value> Runner::probe(const std::string& name) {
    const Instance& instance = *plan_->graph.get(name).instance;
    loop_.adoptInjections();
    Probe probe;
    std::size_t count = 0;
    for (const InputPort* input : accessTo(instance.component()).inputs())
        count = probe.add(*input) + 1;
    for (const OutputPort* output : accessTo(instance.component()).outputs())
        count = probe.add(*output) + 1;
    std::vector<Probe::Value> values;
    if (!loop_.probe(probe, kProbeTimeout + 2 * settings_.loop.period_ns)) return values;
    for (std::size_t i = 0; i < count; ++i) values.push_back(probe.value(i));
    return values;
}

std::vector<std::string> Runner::states(const std::string& name) {
    StateTexts states(plan_->graph.get(name).instance->component());
    Adoption look;
    look.copies = states.copies();
    // A query must not delay the loop.
    if (look.copies.empty() || bytesOf(look.copies) > boundary_.mostBytes()) return {};
    if (!loop_.adopt(look, kProbeTimeout + 2 * settings_.loop.period_ns)) return {};
    return states.texts();
}

}  // namespace rtcf::executor
