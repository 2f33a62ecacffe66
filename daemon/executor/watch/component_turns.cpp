#include "watch/component_turns.hpp"

namespace rtcf::executor {

namespace {

constexpr std::int64_t kDidNotRun = -1;

void appendNumber(std::int64_t number, std::string& to) {
    to.append(reinterpret_cast<const char*>(&number), sizeof number);
}

}  // namespace

ComponentTurns::ComponentTurns(const Schedule& schedule, const CycleCounter& counter)
    : counter_(counter) {
    for (const Step& step : schedule.steps) components_.push_back(step.component->fullName());
}

void ComponentTurns::pack(const Frame& frame, std::string& to) const {
    const CycleTicks& ticks = frame.ticks();
    // The last cycle of a loop runs safe(), which is not timed.
    appendNumber(frame.lastOfLoop() ? kDidNotRun : counter_.toNs(ticks.ready - ticks.begin), to);
    for (std::size_t i = 0; i < components_.size(); ++i) {
        const auto ended = static_cast<std::int64_t>(frame.ended()[i]);
        appendNumber(ended != 0 ? counter_.toNs(ended - ticks.begin) : kDidNotRun, to);
    }
}

}  // namespace rtcf::executor
