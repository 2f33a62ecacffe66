#include "runner/offline_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "common/error.hpp"

namespace rtcf::executor {

OfflineRun::OfflineRun(std::string runner, Loop& loop, LoopControl& control, ActivePlan& plan,
                       FrameKeeper& frames, const Publication& publication, BridgeLink& bridge,
                       Transactions& transactions, Log& log)
    : runner_(std::move(runner)),
      loop_(loop),
      control_(control),
      plan_(plan),
      frames_(frames),
      publication_(publication),
      bridge_(bridge),
      transactions_(transactions),
      log_(log) {}

ChangeOutcome OfflineRun::step(std::uint64_t cycles, const Progress& progress,
                               const std::atomic<bool>* given_up) {
    constexpr std::uint64_t kChunk = 10000;  // cycles between reports
    control_.requireNoLoop();
    if (control_.state() != RunnerState::Stepping) control_.beginStepping(progress);
    std::uint64_t left = cycles;
    while (left > 0) {
        const std::uint64_t wanted = std::min(left, kChunk);
        const std::uint64_t done = frames_.step(wanted, given_up);
        left -= done;
        log_.drain();
        if (done < wanted) break;
        if (left > 0) progress(fmt::format("{} of {} cycles", cycles - left, cycles));
    }
    if (ended()) end();
    ChangeOutcome result = outcomeWith(*plan_);
    result.cycles = cycles - left;
    return result;
}

bool OfflineRun::ended() const {
    return loop_.fault().kind != LoopFault::Kind::None || loop_.stopRequested();
}

ReplayOutcome OfflineRun::replay(const ReplayChunk& chunk, const Progress& progress) {
    ReplayOutcome outcome;
    if (chunk.begin) {
        outcome = beginReplay(chunk, progress);
    } else if (!replay_) {
        throw Error(ErrorKind::NoReplay,
                    fmt::format("no replay of {} is under way: it was stopped", runner_));
    } else {
        try {
            outcome = replay_->run(chunk);
        } catch (...) {
            end();
            throw;
        }
    }
    log_.drain();
    const bool failed = ended();
    if ((chunk.end && !outcome.more) || failed) end();
    if (failed) throw Error(ErrorKind::LoopFailed, publication_.status().loop_fault);
    return outcome;
}

ReplayOutcome OfflineRun::beginReplay(const ReplayChunk& chunk, const Progress& progress) {
    control_.requireNoLoop();
    end();
    Replay::check(plan_->bridgeTable(), chunk.topics);
    // Before the components are recreated, so that ROS never uses a port of the replay.
    connectBridge(false);
    try {
        transactions_.renewComponents(progress);
        control_.beginStepping(progress, chunk.start_ns);
    } catch (...) {
        connectBridge(true);
        throw;
    }
    replay_ = std::make_unique<Replay>(plan_->bridgeTable(), loop_, frames_, chunk.start_ns);
    transactions_.setReplaying(true);
    ReplayOutcome outcome;
    replay_->describe(outcome);
    return outcome;
}

void OfflineRun::connectBridge(bool connected) {
    bridge_.serve(connected, *plan_, *publication_.graph());
}

void OfflineRun::end() {
    if (control_.state() != RunnerState::Stepping) return;
    loop_.endStepping();
    if (replay_) {
        replay_->discardOutputs();  // ROS must not get them
        replay_.reset();
        transactions_.setReplaying(false);
        connectBridge(true);
    }
    control_.steppingEnded();
}

}  // namespace rtcf::executor
