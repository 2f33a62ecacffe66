// Runner: taking and restoring snapshots.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <time.h>

#include <algorithm>

#include "common/refusal.hpp"
#include "image/image_restorer.hpp"
#include "image/image_taker.hpp"
#include "realtime/cycle_counter.hpp"
#include "runner/runner.hpp"

namespace rtcf::executor {

namespace {

// Limit of the memory that a snapshot touches in one cycle at 2 kHz; scaled with the period at
// other frequencies.
constexpr std::int64_t kLargestImage = 64 * 1024;  // bytes of memory touched
constexpr std::int64_t kItsPeriod = 500'000;       // ns
constexpr std::size_t kToldComponents = 5;

}  // namespace

std::size_t Runner::mostAtOnce() const {
    if (!loop_.inRealTime()) return SIZE_MAX;
    return static_cast<std::size_t>(kLargestImage * settings_.loop.period_ns / kItsPeriod);
}

void Runner::requireSmall(std::size_t bytes, const char* what) const {
    const std::size_t most = mostAtOnce();
    if (bytes <= most) return;
    throw Refusal(
        RefusalKind::ResourceExhausted,
        fmt::format(
            "{} touches {} bytes in one cycle of {}; the limit is {} at {:g} Hz: stop the loop, "
            "or lower its frequency",
            what, bytes, name_, most, settings_.frequency_hz));
}

ImageOutcome Runner::takeImage() {
    noticeEnd();
    ImageTaker taker(*plan_);
    // The first capture finds the lengths of values; they may grow until the next one.
    for (int tries = 4; tries > 0; --tries) {
        requireSmall(taker.capture().bytes(), "a snapshot");
        if (!loop_.capture(taker.capture(), adoptionTimeout())) {
            throw Refusal(RefusalKind::Unavailable,
                          fmt::format("the loop of {} reaches no cycle boundary: {}", name_,
                                      whatDoesNotReturn()));
        }
        if (!taker.capture().lacks_room) break;
        taker.makeRoom();
    }
    if (taker.capture().lacks_room) {
        throw Refusal(RefusalKind::Unavailable,
                      fmt::format("values in {} grow faster than they can be copied: take the "
                                  "snapshot again, or stop the loop",
                                  name_));
    }
    ImageOutcome outcome{taker.image(), {}};
    outcome.image.runner = name_;
    outcome.image.taken_ns = realtimeNow();
    outcome.image.period_ns = settings_.loop.period_ns;
    std::vector<std::string> stateless;
    for (const ImageComponent& component : outcome.image.components) {
        if (component.states.empty()) stateless.push_back(component.name);
    }
    if (!stateless.empty()) {
        const std::size_t told = std::min(stateless.size(), kToldComponents);
        std::string names = fmt::format(
            "{}", fmt::join(stateless.begin(),
                            stateless.begin() + static_cast<std::ptrdiff_t>(told), ", "));
        if (stateless.size() > told) names += fmt::format(" and {} more", stateless.size() - told);
        outcome.notes.push_back(
            "the snapshot omits values that components without declared state keep between "
            "cycles: " +
            names);
    }
    return outcome;
}

ChangeOutcome Runner::restore(const RunnerImage& image, const Progress& progress) {
    noticeEnd();
    requireNoReplay();
    if (image.period_ns != settings_.loop.period_ns) {
        const double frequency = 1e9 / static_cast<double>(image.period_ns);
        throw Refusal(RefusalKind::FailedPrecondition,
                      fmt::format("the snapshot was taken at {0:g} Hz, but {1} runs at {2:g} Hz: "
                                  "rtcfctl runner set {1} --frequency {0:g}",
                                  frequency, name_, settings_.frequency_hz));
    }
    ImageRestorer restorer(image, *plan_);
    requireSmall(restorer.restoration().bytes(), "the snapshot");
    if (loop_.inRealTime()) restorer.requireReserved();
    const bool begins = !loop_.joinable() && state_ != RunnerState::Stepping;
    restorer.restoration().sets_time = !loop_.joinable();

    Change change;
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
        if (begins) pause(progress);
        begun = begins;
        adopt(std::move(change), progress);
    } catch (...) {
        for (auto& [instance, before] : values) instance->restoreParameterValues(before);
        for (const auto& [instance, phase] : phases) instance->setPhase(phase);
        if (begun) endStepping();
        throw;
    }
    restorer.noteIn(*plan_);
    ChangeOutcome result = outcome();
    if (begins) {
        result.notes.emplace_back(
            "the loop is paused, as after a step: rtcfctl step continues from the snapshot, "
            "rtcfctl start starts anew");
    }
    return result;
}

}  // namespace rtcf::executor
