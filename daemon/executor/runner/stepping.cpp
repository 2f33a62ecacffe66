// Runner: cycles without real time, in steps and replays.
#include <fmt/format.h>

#include <algorithm>

#include "common/refusal.hpp"
#include "runner/runner.hpp"

namespace rtcf::executor {

// Steps and replays require that the loop does not run.
void Runner::requireNoLoop() {
    noticeEnd();
    if (!loop_.joinable()) return;
    throw Refusal(
        RefusalKind::LoopRuns,
        fmt::format("the loop of {0} runs in real time: stop it first: rtcfctl -r {0} stop",
                    name_));
}

// After startAll().
void Runner::beginStepping(std::int64_t stamp_ns) {
    try {
        loop_.beginStepping(settings_.loop, job_stops_, stamp_ns);
    } catch (...) {
        stopAll();
        throw;
    }
}

// Prepares the first step.
void Runner::pause(const Progress& progress) {
    startAll(progress);
    beginStepping();
    setState(RunnerState::Stepping);
    status_.clear();
    publish();
}

ChangeOutcome Runner::step(std::uint64_t cycles, const Progress& progress,
                           const std::atomic<bool>* given_up) {
    constexpr std::uint64_t kChunk = 10000;  // cycles between reports
    requireNoLoop();
    if (state_ != RunnerState::Stepping) pause(progress);
    std::uint64_t left = cycles;
    while (left > 0) {
        const std::uint64_t wanted = std::min(left, kChunk);
        const std::uint64_t done = frames_.step(wanted, given_up);
        left -= done;
        log_.drain();
        activity_.end();  // resets the time of the activity, as a long run is not a hook that hangs
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
        throw Refusal(RefusalKind::NoReplay,
                      fmt::format("no replay of {} is under way: it was stopped", name_));
    } else {
        try {
            outcome = replay_->run(chunk);
        } catch (...) {
            endStepping();
            throw;
        }
    }
    log_.drain();
    activity_.end();
    const bool ended = loop_.fault().kind != LoopFault::Kind::None || loop_.stopRequested();
    if ((chunk.end && !outcome.more) || ended) endStepping();
    if (ended) throw Refusal(RefusalKind::LoopFailed, status_);
    return outcome;
}

ReplayOutcome Runner::beginReplay(const ReplayChunk& chunk, const Progress& progress) {
    requireNoLoop();
    if (state_ == RunnerState::Stepping) endStepping();
    Replay::check(plan_->bridgeTable(), chunk.topics);
    // Before the components are recreated, so that ROS never uses a port of the replay.
    serveBridge(false);
    try {
        renewComponents(progress);
        startAll(progress);
        beginStepping(chunk.start_ns);
    } catch (...) {
        serveBridge(true);
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

void Runner::serveBridge(bool served) {
    bridge_served_ = served;
    if (bridge_) bridge_->setTable(bridgeTable());
}

// Recreates the components with the same parameters, but without state and old values of inputs.
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
    adopt({}, progress);  // removes all values of connections
    try {
        adopt(std::move(renewed), progress);
    } catch (...) {
        adopt(std::move(previous), progress);
        throw;
    }
}

void Runner::endStepping() {
    loop_.endStepping();
    if (replay_) {
        replay_->discardOutputs();  // ROS must not get them
        replay_.reset();
        serveBridge(true);
    }
    noteLoopFault();
    stopAll();
    publish({loop_.fault().component_name.data()});
}

}  // namespace rtcf::executor
