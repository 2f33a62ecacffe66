#include "watch/component_turns.hpp"

#include <cstring>

namespace rtcf::executor {

namespace {

constexpr std::int64_t kDidNotRun = -1;

std::int64_t ticksAt(const Frame& frame, std::size_t offset) {
    std::int64_t ticks = 0;
    std::memcpy(&ticks, frame.values() + offset, sizeof ticks);
    return ticks;
}

void appendNumber(std::int64_t number, std::string& to) {
    to.append(reinterpret_cast<const char*>(&number), sizeof number);
}

}  // namespace

ComponentTurns::ComponentTurns(const Schedule& schedule, const CycleCounter& counter,
                               const FrameRing& ring, std::size_t first)
    : counter_(counter) {
    for (const Step& step : schedule.steps) components_.push_back(step.component->fullName());
    for (std::size_t source = first; source < ring.sources().size(); ++source)
        offsets_.push_back(ring.offset(source));
}

void ComponentTurns::appendSources(const Schedule& schedule, const Cycle& cycle,
                                   std::vector<FrameRing::Source>& sources) {
    const CycleMarks& marks = cycle.marks();
    sources.push_back({&marks.begin, sizeof marks.begin});
    sources.push_back({&marks.ready, sizeof marks.ready});
    for (const Step& step : schedule.steps)
        sources.push_back({&step.ended_ticks, sizeof step.ended_ticks});
}

void ComponentTurns::pack(const Frame& frame, std::string& to) const {
    // The last cycle of a loop runs safe(), which is not timed.
    const std::int64_t begin = ticksAt(frame, offsets_[0]);
    const bool timed = !frame.lastOfLoop();
    appendNumber(timed ? counter_.toNs(ticksAt(frame, offsets_[1]) - begin) : kDidNotRun, to);
    for (std::size_t i = 2; i < offsets_.size(); ++i) {
        const std::int64_t ended = ticksAt(frame, offsets_[i]);
        appendNumber(timed && ended >= begin ? counter_.toNs(ended - begin) : kDidNotRun, to);
    }
}

}  // namespace rtcf::executor
