#include "runner/snapshots.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "common/error.hpp"
#include "realtime/cycle_counter.hpp"
#include "snapshot/snapshot_restorer.hpp"
#include "snapshot/snapshot_taker.hpp"

namespace rtcf::executor {

namespace {

constexpr std::size_t kNamedComponents = 5;

}  // namespace

Snapshots::Snapshots(std::string runner, const RunnerSettings& settings, const Loop& loop,
                     LoopBoundary& boundary, LoopControl& control, ActivePlan& plan,
                     Transactions& transactions, OfflineRun& offline)
    : runner_(std::move(runner)),
      settings_(settings),
      loop_(loop),
      boundary_(boundary),
      control_(control),
      plan_(plan),
      transactions_(transactions),
      offline_(offline) {}

SnapshotOutcome Snapshots::take() {
    control_.noticeEnd();
    SnapshotTaker taker(*plan_);
    // The first capture finds the lengths of values; they may grow until the next one.
    for (int tries = 4; tries > 0; --tries) {
        boundary_.requireSmall(taker.capture().bytes(), "a snapshot");
        boundary_.capture(taker.capture());
        if (!taker.capture().lacks_room) break;
        taker.makeRoom();
    }
    if (taker.capture().lacks_room) {
        throw Error(ErrorKind::Unavailable,
                    fmt::format("values in {} grow faster than they can be copied: take the "
                                "snapshot again, or stop the loop",
                                runner_));
    }
    SnapshotOutcome outcome{taker.snapshot(), {}};
    outcome.snapshot.runner = runner_;
    outcome.snapshot.taken_ns = realtimeNow();
    outcome.snapshot.period_ns = settings_.loop.period_ns;
    std::vector<std::string> stateless;
    for (const SnapshotComponent& component : outcome.snapshot.components) {
        if (component.states.empty()) stateless.push_back(component.name);
    }
    if (!stateless.empty()) {
        const std::size_t named = std::min(stateless.size(), kNamedComponents);
        std::string names = fmt::format(
            "{}", fmt::join(stateless.begin(),
                            stateless.begin() + static_cast<std::ptrdiff_t>(named), ", "));
        if (stateless.size() > named)
            names += fmt::format(" and {} more", stateless.size() - named);
        outcome.notes.push_back(
            "the snapshot omits values that components without declared state keep between "
            "cycles: " +
            names);
    }
    return outcome;
}

ChangeOutcome Snapshots::restore(const Snapshot& snapshot, const Progress& progress) {
    control_.noticeEnd();
    transactions_.requireNoReplay();
    if (snapshot.period_ns != settings_.loop.period_ns) {
        const double frequency = 1e9 / static_cast<double>(snapshot.period_ns);
        throw Error(ErrorKind::FailedPrecondition,
                    fmt::format("the snapshot was taken at {0:g} Hz, but {1} runs at {2:g} Hz: "
                                "rtcfctl runner set {1} --frequency {0:g}",
                                frequency, runner_, settings_.frequency_hz));
    }
    SnapshotRestorer restorer(snapshot, *plan_, loop_.inRealTime());
    boundary_.requireSmall(restorer.restoration().bytes(), "the snapshot");
    if (loop_.inRealTime()) restorer.requireReserved();
    const bool begins = !loop_.joinable() && control_.state() != RunnerState::Stepping;
    restorer.restoration().sets_time = !loop_.joinable();

    Transactions::Change change;
    change.graph = plan_->graph;
    change.restoration = &restorer.restoration();
    std::vector<std::pair<Instance*, std::vector<ParameterValue>>> values;
    std::vector<std::pair<Instance*, std::uint32_t>> phases;
    bool begun = false;
    try {
        for (const auto& [instance, batch] : restorer.parameters()) {
            values.emplace_back(instance, instance->parameterValues());
            for (StagedValue* staged : instance->stageParameters(batch))
                change.values.push_back(staged);
            change.changed.insert(instance->fullName());
        }
        for (const auto& [instance, phase] : restorer.phases()) {
            phases.emplace_back(instance, instance->phase());
            instance->setPhase(phase);
        }
        // Last, because it calls start hooks.
        if (begins) control_.beginStepping(progress);
        begun = begins;
        transactions_.adopt(std::move(change), progress);
    } catch (...) {
        for (auto& [instance, before] : values) instance->restoreParameterValues(before);
        for (const auto& [instance, phase] : phases) instance->setPhase(phase);
        if (begun) offline_.end();
        throw;
    }
    restorer.noteIn(*plan_);
    ChangeOutcome result = outcomeWith(*plan_);
    if (begins) {
        result.notes.emplace_back(
            "the loop is paused, as after a step: rtcfctl step continues from the snapshot, "
            "rtcfctl start starts anew");
    }
    return result;
}

}  // namespace rtcf::executor
