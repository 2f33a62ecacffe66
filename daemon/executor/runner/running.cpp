// Runner: settings, start and stop of the loop.
#include <fmt/format.h>

#include <algorithm>
#include <rtcf/design_period.hpp>

#include "common/refusal.hpp"
#include "runner/runner.hpp"

namespace rtcf::executor {

namespace {

// Adds texts without duplicates: the priority is checked for the process and for the thread.
void addTexts(RealtimeProblems problems, std::vector<std::string>& texts) {
    for (RealtimeProblem& problem : problems) {
        if (std::find(texts.begin(), texts.end(), problem.text) == texts.end())
            texts.push_back(std::move(problem.text));
    }
}

// Lets a component compute the values that depend on its period for another one.
void stagePeriod(Instance& instance, std::int64_t loop_period_ns,
                 std::vector<StagedValue*>& values) {
    for (DerivedBase* derived : instance.component().derived()) {
        auto* const period = dynamic_cast<DesignPeriod*>(derived);
        if (period == nullptr) continue;
        period->propose(loop_period_ns * instance.definition().every);
        const std::vector<StagedValue*> staged = instance.stageParameters({});
        values.insert(values.end(), staged.begin(), staged.end());
        return;
    }
}

}  // namespace

void Runner::configure(RunnerSettings settings) {
    validate(settings);
    const RunnerSettings previous = std::exchange(settings_, std::move(settings));
    try {
        Change change;
        change.graph = plan_->graph;
        if (settings_.loop.period_ns != previous.loop.period_ns) {
            change.period_ns = settings_.loop.period_ns;
            for (const GraphNode& node : change.graph.nodes())
                stagePeriod(*node.instance, change.period_ns, change.values);
        }
        adopt(std::move(change), [](const std::string&) {});
    } catch (...) {
        for (const GraphNode& node : plan_->graph.nodes()) node.instance->releaseStaged();
        settings_ = previous;
        throw;
    }
    spin_tuner_.reset();
    if (loop_.joinable()) {
        RealtimeProblems of_thread = loop_.retune(loopSettings());
        if (loop_.inRealTime()) {
            degraded_.clear();
            addTexts(memory_problems_, degraded_);
            addTexts(checkScheduling(settings_.loop.realtime), degraded_);
            addTexts(std::move(of_thread), degraded_);
        }
        loop_.setMostOverruns(mostOverruns());
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
        addTexts(lockAndStart(), degraded_);
        loop_.setMostOverruns(mostOverruns());
    } catch (...) {
        simulate(false);
        stopAll();
        throw;
    }
    setState(RunnerState::Running);
    status_.clear();
    publish();
    for (const std::string& problem : degraded_) {
        tell({RunnerEvent::Kind::Degraded, "degraded real time: " + problem, {}, 0});
    }
    ChangeOutcome result = outcome();
    result.degraded = degraded_;
    return result;
}

// A stop is final: a job posted before it must not start cycles.
void Runner::requireNoStop() const {
    if (loop_.stops() == job_stops_) return;
    throw Refusal(
        RefusalKind::LoopStopped,
        fmt::format("the loop of {} is not started: a stop was requested after the start", name_));
}

RealtimeProblems Runner::lockAndStart() {
    LoopSettings settings = settings_.loop;
    settings.max_overruns = 0;  // until the missing prerequisites are known
    if (simulated_) return loop_.start(settings, job_stops_);
    memory_problems_ = lockMemory(settings_.loop.realtime);
    RealtimeProblems problems = memory_problems_;
    for (RealtimeProblem& problem : checkScheduling(settings_.loop.realtime))
        problems.push_back(std::move(problem));
    for (const RealtimeProblem& problem : problems) {
        if (!problem.essential || !settings_.realtime_required) continue;
        throw Refusal(RefusalKind::NoRealtime,
                      fmt::format("no real time: {}; to run degraded: rtcfctl runner set {} "
                                  "--realtime preferred",
                                  problem.text, name_));
    }
    spin_tuner_.reset();
    for (RealtimeProblem& problem : loop_.start(settings, job_stops_))
        problems.push_back(std::move(problem));
    return problems;
}

// The setting max_overruns, or 0 (never stop) without real time, as the graph does not cause all
// late cycles then.
std::uint32_t Runner::mostOverruns() const noexcept {
    return degraded_.empty() ? settings_.loop.max_overruns : 0;
}

LoopSettings Runner::loopSettings() const {
    LoopSettings settings = settings_.loop;
    settings.max_overruns = mostOverruns();
    return settings;
}

ChangeOutcome Runner::stop(const Progress& progress) {
    if (loop_.joinable()) {
        progress("stopping the loop");
        if (!loop_.stopRequested()) loop_.requestStop();  // once, so that a later start stays valid
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

void Runner::loopEnded() {
    loop_.join(INT64_MAX);
    simulate(false);
    noteOverruns(true);
    noteLoopFault();
    stopAll();
    publish({loop_.fault().component_name.data()});
}

void Runner::startAll(const Progress& progress) {
    told_not_finite_ = {};
    std::vector<Instance*> started;
    try {
        for (const std::size_t index : plan_->wiring.order) {
            Instance& instance = *plan_->graph.nodes()[index].instance;
            progress("starting " + instance.fullName());
            requireNoStop();
            activity_.begin(instance.fullName() + ".start");
            started.push_back(&instance);
            instance.setFault({});
            instance.start();
        }
        requireNoStop();
    } catch (...) {
        for (auto instance = started.rbegin(); instance != started.rend(); ++instance)
            (*instance)->stop();
        throw;
    }
}

void Runner::stopAll() noexcept {
    // In reverse order of execution, so that a component's writers run as long as it does.
    for (auto index = plan_->wiring.order.rbegin(); index != plan_->wiring.order.rend(); ++index) {
        Instance& instance = *plan_->graph.nodes()[*index].instance;
        activity_.begin(instance.fullName() + ".stop");
        instance.stop();
    }
}

}  // namespace rtcf::executor
