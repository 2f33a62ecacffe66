#include "runner/loop_control.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "common/error.hpp"
#include "logging/log_errors.hpp"

namespace rtcf::executor {

namespace {

// Adds texts without duplicates: the priority is checked for the process and for the thread.
void addTexts(RealtimeProblems problems, std::vector<std::string>& texts) {
    for (RealtimeProblem& problem : problems) {
        if (std::find(texts.begin(), texts.end(), problem.text) == texts.end())
            texts.push_back(std::move(problem.text));
    }
}

}  // namespace

LoopControl::LoopControl(std::string runner, RunnerSettings& settings, Loop& loop,
                         const LoopBoundary& boundary, ActivePlan& plan, Publication& publication,
                         BridgeLink& bridge, Log& log, ReportEvent report_event,
                         const std::atomic<bool>& ending)
    : runner_(std::move(runner)),
      settings_(settings),
      loop_(loop),
      boundary_(boundary),
      plan_(plan),
      publication_(publication),
      bridge_(bridge),
      log_(log),
      report_event_(std::move(report_event)),
      stall_monitor_(loop),
      simulation_(loop, bridge, ending),
      faults_(runner_, loop, log, report_event_,
              [this](const std::string& component) { publish({component}); }) {
    stall_monitor_.setTimeout(settings.stall_timeout_ns);
}

void LoopControl::applySettings() {
    spin_tuner_.reset();
    if (loop_.joinable()) {
        LoopSettings settings = settings_.loop;
        settings.max_overruns = mostOverruns();
        RealtimeProblems of_thread = loop_.retune(settings);
        if (loop_.inRealTime()) {
            degraded_.clear();
            addTexts(memory_problems_, degraded_);
            addTexts(checkScheduling(settings_.loop.realtime), degraded_);
            addTexts(std::move(of_thread), degraded_);
        }
        loop_.setMostOverruns(mostOverruns());
    }
    stall_monitor_.setTimeout(settings_.stall_timeout_ns);
}

const std::vector<std::string>& LoopControl::start(const Progress& progress) {
    const bool simulated = simulation_.wanted(settings_, progress, [this] { requireNoStop(); });
    startComponents(simulated ? Pace::Clock : Pace::RealTime, progress);
    try {
        if (simulated)
            simulation_.begin(settings_, *plan_);
        else
            simulation_.end(settings_, *plan_);
        progress("starting the loop");
        degraded_.clear();
        addTexts(lockAndStart(), degraded_);
        loop_.setMostOverruns(mostOverruns());
    } catch (...) {
        simulation_.end(settings_, *plan_);
        plan_.stopComponents();
        throw;
    }
    publication_.setState(RunnerState::Running);
    loop_fault_.clear();
    reportOldMessages();
    publish();
    for (const std::string& problem : degraded_) {
        report_event_({RunnerEvent::Kind::Degraded, "degraded real time: " + problem, {}, 0});
    }
    return degraded_;
}

// A stop is final: a job posted before it must not start cycles.
void LoopControl::requireNoStop() const {
    if (loop_.stops() == job_stops_) return;
    throw Error(ErrorKind::LoopStopped,
                fmt::format("the loop of {} is not started: a stop was requested after the start",
                            runner_));
}

void LoopControl::startComponents(Pace pace, const Progress& progress) {
    faults_.restart();
    loop_.announce(pace);
    plan_.startComponents(progress, [this] { requireNoStop(); });
}

RealtimeProblems LoopControl::lockAndStart() {
    LoopSettings settings = settings_.loop;
    settings.max_overruns = 0;  // until the missing prerequisites are known
    if (simulation_.active()) return loop_.start(settings, job_stops_);
    memory_problems_ = lockMemory(settings_.loop.realtime);
    RealtimeProblems problems = memory_problems_;
    for (RealtimeProblem& problem : checkScheduling(settings_.loop.realtime))
        problems.push_back(std::move(problem));
    for (const RealtimeProblem& problem : problems) {
        if (!problem.essential || !settings_.realtime_required) continue;
        throw Error(ErrorKind::NoRealtime,
                    fmt::format("no real time: {}; to run degraded: rtcfctl runner set {} "
                                "--realtime preferred",
                                problem.text, runner_));
    }
    spin_tuner_.reset();
    for (RealtimeProblem& problem : loop_.start(settings, job_stops_))
        problems.push_back(std::move(problem));
    return problems;
}

// The setting max_overruns, or 0 (never stop) without real time, as the graph does not cause all
// late cycles then.
std::uint32_t LoopControl::mostOverruns() const noexcept {
    return degraded_.empty() ? settings_.loop.max_overruns : 0;
}

void LoopControl::stop(const Progress& progress) {
    progress("stopping the loop");
    if (!loop_.stopRequested()) loop_.requestStop();  // once, so that a later start stays valid
    if (!loop_.join(boundary_.timeout())) {
        throw Error(ErrorKind::Unavailable,
                    fmt::format("the loop of {} does not reach the end of its cycle: {}", runner_,
                                boundary_.whatHoldsIt()));
    }
    loopEnded();
}

void LoopControl::noticeEnd() {
    if (state() == RunnerState::Running && !loop_.running()) loopEnded();
}

void LoopControl::requireNoLoop() {
    noticeEnd();
    if (!loop_.joinable()) return;
    throw Error(ErrorKind::LoopRuns,
                fmt::format("the loop of {0} runs in real time: stop it first: rtcfctl -r {0} stop",
                            runner_));
}

void LoopControl::loopEnded() {
    loop_.join(INT64_MAX);
    simulation_.end(settings_, *plan_);
    reportOverruns(true);
    simulation_.report(report_event_, true);
    noteLoopFault();
    plan_.stopComponents();
    publish({loop_.fault().component_name.data()});
}

void LoopControl::noteLoopFault() {
    const bool faulted = loop_.fault().kind != LoopFault::Kind::None;
    publication_.setState(faulted ? RunnerState::Faulted : RunnerState::Stopped);
    if (!faulted) return;
    const RunnerEvent event = faults_.endOfLoop(plan_->graph, settings_.loop.max_overruns);
    loop_fault_ = event.message;
    report_event_(event);
}

void LoopControl::beginStepping(const Progress& progress, std::int64_t stamp_ns) {
    startComponents(Pace::Steps, progress);
    try {
        loop_.beginStepping(settings_.loop, job_stops_, stamp_ns);
    } catch (...) {
        plan_.stopComponents();
        throw;
    }
    publication_.setState(RunnerState::Stepping);
    loop_fault_.clear();
    reportOldMessages();
    publish();
}

void LoopControl::steppingEnded() {
    noteLoopFault();
    plan_.stopComponents();
    publish({loop_.fault().component_name.data()});
}

void LoopControl::tick() {
    noticeEnd();
    if (loop_.joinable()) {
        loop_.refreshWallClock();
        if (settings_.spin_auto) spin_tuner_.tune(loop_, settings_.loop.period_ns);
    }
    faults_.reportComponents(plan_->graph);
    reportOverruns(false);
    simulation_.report(report_event_, false);
    faults_.reportLostMessages(*plan_, settings_.bridge.largest_message);
}

void LoopControl::reportOverruns(bool last) {
    const bool limit_ignored = !degraded_.empty() && settings_.loop.max_overruns != 0;
    faults_.reportOverruns(plan_->graph, last,
                           limit_ignored ? "; max_overruns does not stop a degraded loop" : "");
}

void LoopControl::reportOldMessages() {
    for (const Feed& feed : plan_->schedule.feeds) {
        const std::uint64_t count = feed.injector->takeDropped();
        if (count == 0) continue;
        log_.write(LogLevel::Warn, {},
                   fmt::format("{} on {} from before the start {} dropped",
                               count == 1 ? "1 message" : fmt::format("{} messages", count),
                               feed.injector->topic(), count == 1 ? "was" : "were"));
    }
}

void LoopControl::finish() noexcept {
    loop_.requestStop();
    loop_.join(INT64_MAX);
    if (state() == RunnerState::Stepping) loop_.endStepping();
    plan_.stopComponents();
    logErrors(log_, "reporting the end", [this] {  // to clients of the bridge
        if (state() != RunnerState::Faulted) publication_.setState(RunnerState::Stopped);
        publishStatus();
    });
}

void LoopControl::publish(const std::set<std::string>& changed) {
    publication_.setGraph(makeGraphView(*plan_, *publication_.graph(), changed));
    publishStatus();
}

void LoopControl::publishStatus() {
    RunnerStatus status;
    status.settings = settings_;
    if (settings_.spin_auto && spin_tuner_.spin())
        status.settings.loop.spin_ns = *spin_tuner_.spin();
    status.degraded = degraded_;
    status.loop_fault = loop_fault_;
    status.bridge = bridge_.status();
    status.simulated = simulation_.active();
    status.clock_silence = simulation_.silence();
    status.too_large = faults_.lostMessages();
    publication_.setStatus(std::move(status));
}

}  // namespace rtcf::executor
