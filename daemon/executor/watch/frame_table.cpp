#include "watch/frame_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "common/error.hpp"

namespace rtcf::executor {

namespace {

constexpr double kSeconds = 1.0;             // that kept frames hold
constexpr double kStatisticsSeconds = 0.25;  // of frames for statistics, which count them sooner
constexpr double kTapSeconds = 0.5;          // of frames for taps
constexpr std::size_t kFewestTapFrames = 64;
constexpr std::size_t kNamesInMessage = 8;

// A column and its place in memory.
struct Candidate {
    FrameColumn column;
    FrameRing::Source source;
    bool needed;  // for a tap, or to restore the output after an update() that throws
};

// The slot of an output of fixed size: its stamp and value.
FrameRing::Source sourceOf(const TypeInfo& type, const SlotHeader& slot) {
    const auto head = static_cast<std::size_t>(valueOf(type, slot) -
                                               reinterpret_cast<const std::uint8_t*>(&slot));
    // As the stamp is a word, slots consist of whole words.
    constexpr std::size_t kWord = FrameCopy::kWord;
    static_assert(alignof(SlotHeader) == kWord && sizeof(SlotHeader) == kWord);
    return {&slot, (head + type.size + kWord - 1) / kWord * kWord, head};
}

std::vector<Candidate> candidatesOf(const Plan& plan) {
    std::set<const SlotHeader*> tapped;
    for (const auto& [topic, tap] : plan.frame_taps) tapped.insert(tap->source());
    std::vector<Candidate> found;
    for (const std::size_t index : plan.wiring.order) {
        const Instance& instance = *plan.graph.nodes()[index].instance;
        const Component& component = instance.component();
        const auto& outputs = accessTo(component).outputs();
        for (std::size_t port = 0; port < outputs.size(); ++port) {
            const OutputPort& output = *outputs[port];
            const TypeInfo& type = output.type();
            if (!type.fixed_size) continue;
            found.push_back({{instance.fullName(), output.name(), type.name, output.unit(),
                              (*instance.ports())[instance.placeOfOutput(port)].mapped_name, &type,
                              type.size, instance.code()},
                             sourceOf(type, *output.slot()),
                             !output.staged() || tapped.count(output.slot().get()) != 0});
        }
        for (const StateDeclaration& state : accessTo(component).states()) {
            found.push_back({{instance.fullName(),
                              state.name,
                              state.type,
                              state.unit,
                              {},
                              nullptr,
                              state.size,
                              instance.code()},
                             {state.value, state.size},
                             false});
        }
    }
    return found;
}

// The best rank of a candidate in the selections of all watches; PortSelection::kNone = not
// watched.
std::size_t rankOf(const Candidate& candidate, const Watches& watches) {
    const std::string name = candidate.column.fullName();
    std::size_t least = PortSelection::kNone;
    for (const auto& [number, watch] : watches) {
        least = std::min(least, watch.selection.rank(name));
    }
    return least;
}

// Chooses all needed candidates, and others while there is room: watched ones first, and of these
// the first ones of each selection. The result is in schedule order.
std::vector<Candidate> chosenOf(const Plan& plan, const FrameDemand& demand, FrameTable& table) {
    std::vector<Candidate> candidates = candidatesOf(plan);
    const bool all = demand.most_bytes != 0;
    const std::size_t most = all ? demand.most_bytes : kLargestFrame;
    std::vector<bool> chosen(candidates.size(), false);
    std::size_t bytes = 0;
    std::size_t left_out = 0;
    for (std::size_t i = 0; i < candidates.size(); ++i) chosen[i] = candidates[i].needed;
    std::vector<std::pair<std::size_t, std::size_t>> ranked;  // rank and place
    for (std::size_t i = 0; i < candidates.size(); ++i) {
        if (candidates[i].needed) continue;
        const std::size_t rank = rankOf(candidates[i], demand.watches);
        if (all || rank != PortSelection::kNone) ranked.emplace_back(rank, i);
    }
    std::sort(ranked.begin(), ranked.end());
    for (const auto& [rank, i] : ranked) {
        const std::size_t size = (candidates[i].column.size + 7) / 8 * 8;
        chosen[i] = bytes + size <= most;
        chosen[i] ? bytes += size : ++left_out;
    }
    if (left_out != 0) {
        table.notes.push_back(fmt::format(
            "{} outputs and states are omitted: a cycle copies at most {} bytes of them: {}",
            left_out, most, all ? "raise frame_kb of the runner" : "select fewer"));
    }
    std::vector<Candidate> found;
    for (std::size_t i = 0; i < candidates.size(); ++i) {
        if (chosen[i]) found.push_back(std::move(candidates[i]));
    }
    return found;
}

// The stamps of outputs of other sizes, which are restored, too, after an update() that throws.
std::vector<FrameRing::Source> stampsOf(const Plan& plan) {
    std::vector<FrameRing::Source> found;
    for (const Step& step : plan.schedule.steps) {
        for (const OutputPort* output : accessTo(*step.component).outputs()) {
            if (!output->type().fixed_size && !output->staged())
                found.push_back({output->slot().get(), sizeof(SlotHeader)});
        }
    }
    return found;
}

// @param optional size of the values that the settings and watches select, bytes
std::string shortnessOf(const FrameRing& ring, std::size_t optional, double frequency_hz) {
    const std::size_t bytes = ring.wordsOfFrame() * FrameCopy::kWord;
    return fmt::format(
        "frames hold the last {} cycles ({:.2g} s), not one second: each takes {:.1f} KiB, and the "
        "ring is limited to {} MiB: {}",
        ring.capacity(), static_cast<double>(ring.capacity()) / frequency_hz,
        static_cast<double>(bytes) / 1024.0, FrameRing::kLargestRing >> 20U,
        2 * optional >= bytes ? "lower frame_kb of the runner, or watch fewer values"
                              : "spread the components over more runners");
}

}  // namespace

std::shared_ptr<const FrameTable> makeFrameTable(const Plan& plan, const FrameDemand& demand) {
    auto table = std::make_shared<FrameTable>();
    table->watches = demand.watches;
    table->kept = demand.most_bytes != 0 || !demand.watches.empty();
    std::vector<FrameRing::Source> sources;
    std::size_t optional = 0;
    for (Candidate& candidate : chosenOf(plan, demand, *table)) {
        if (!candidate.needed) optional += candidate.column.size;
        sources.push_back(candidate.source);
        table->columns.push_back(std::move(candidate.column));
    }
    for (const auto& [topic, tap] : plan.frame_taps) {
        const auto source = std::find_if(
            sources.begin(), sources.end(),
            [&tap = tap](const FrameRing::Source& each) { return each.from == tap->source(); });
        table->taps.push_back({tap, static_cast<std::size_t>(source - sources.begin())});
    }
    for (const FrameRing::Source& stamp : stampsOf(plan)) sources.push_back(stamp);
    for (const std::size_t index : plan.wiring.order)
        table->components.push_back(plan.graph.nodes()[index].instance->statistics());
    const CycleCounter& counter = demand.counter;
    if (std::any_of(demand.watches.begin(), demand.watches.end(),
                    [](const auto& watch) { return watch.second.turns; }))
        table->turns = {plan.schedule, counter};
    double seconds = table->taps.empty() ? kStatisticsSeconds : kTapSeconds;
    if (table->kept) seconds = kSeconds;
    const auto frames = std::max(static_cast<std::size_t>(std::ceil(seconds * demand.frequency_hz)),
                                 table->taps.empty() ? 0 : kFewestTapFrames);
    const std::size_t steps = table->components.size();
    const std::size_t capacity = FrameRing::capacityFor(sources, steps, frames);
    const FrameTable* const previous = demand.previous;
    const auto note_shortness = [&] {
        if (table->kept && capacity < frames)
            table->shortness = shortnessOf(*table->ring, optional, demand.frequency_hz);
    };
    if (previous != nullptr && previous->kept == table->kept &&
        previous->components == table->components && previous->ring->sources() == sources &&
        previous->ring->capacity() == capacity) {
        table->ring = previous->ring;
        note_shortness();
        if (previous->shortness == table->shortness) return table;
    }
    table->ring = std::make_shared<FrameRing>(std::move(sources), steps, frames, counter,
                                              table->kept ? demand.memory : nullptr);
    note_shortness();
    if (const auto& block = table->ring->block(); block != nullptr) {
        std::vector<std::string> remarks = table->notes;
        if (!table->shortness.empty()) remarks.push_back(table->shortness);
        demand.memory->announce(block, table->ring->capacity(), table->ring->wordsOfFrame(),
                                frameLayout(*table->ring, table->columns, remarks));
    }
    return table;
}

void requireMatches(const PortSelection& selection, const Plan& plan) {
    std::vector<std::string> names;
    for (const Candidate& candidate : candidatesOf(plan))
        names.push_back(candidate.column.fullName());
    for (const PortSelection::Pattern& pattern : selection.patterns()) {
        if (std::any_of(names.begin(), names.end(),
                        [&](const std::string& name) { return pattern.matches(name); }))
            continue;
        if (names.empty()) {
            throw Error(ErrorKind::PortNotFound,
                        fmt::format("{} matches nothing: no component of this runner has an "
                                    "output of fixed size or declared state",
                                    pattern.given()));
        }
        const bool all = names.size() <= kNamesInMessage;
        if (!all) names.resize(kNamesInMessage);
        throw Error(ErrorKind::PortNotFound,
                    fmt::format("{} matches no output of fixed size and no state; available: {}{}",
                                pattern.given(), fmt::join(names, ", "), all ? "" : ", …"));
    }
}

}  // namespace rtcf::executor
