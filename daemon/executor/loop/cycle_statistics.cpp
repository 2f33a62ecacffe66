#include "loop/cycle_statistics.hpp"

#include <memory>
#include <vector>

namespace rtcf::executor {

void CycleStatistics::follow(const CycleFrames& frames) {
    const std::lock_guard<std::mutex> lock(mutex_);
    countFrames();
    reader_.follow(frames);
}

double CycleStatistics::count() {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto counted = static_cast<double>(countFrames());
    const CycleFrames* const frames = reader_.present();
    return frames == nullptr ? 0.0 : counted / static_cast<double>(frames->ring->capacity());
}

std::size_t CycleStatistics::capacity() {
    const std::lock_guard<std::mutex> lock(mutex_);
    const CycleFrames* const frames = reader_.present();
    return frames == nullptr ? 0 : frames->ring->capacity();
}

// @return number of frames that were read or lost
std::uint64_t CycleStatistics::countFrames() {
    const std::uint64_t lost = reader_.lost();
    std::uint64_t read = 0;
    while (const CycleFrames* const frames = reader_.next(frame_)) {
        add(*frames);
        // A loop that steps as fast as it can may fill frames faster than they are counted.
        if (++read >= 2 * frames->ring->capacity()) break;
    }
    lost_.store(reader_.lost() - lost_before_, std::memory_order_relaxed);
    return read + reader_.lost() - lost;
}

void CycleStatistics::add(const CycleFrames& frames) {
    if (!frame_.counted()) return;
    const CycleTicks& ticks = frame_.ticks();
    duration_.add(ticks.end - ticks.begin);
    latency_.add(frame_.cycle().latency_ns);
    std::int64_t before = ticks.ready;
    const std::uint64_t* ended = frame_.ended();
    for (const auto& component : frames.components) {
        const auto after = static_cast<std::int64_t>(*ended++);
        if (after == 0) continue;  // it did not run
        component->duration.add(after - before);
        before = after;
    }
}

void CycleStatistics::restart() {
    const std::lock_guard<std::mutex> lock(mutex_);
    std::vector<EventCounter*> counters{&loop_.overruns,       &loop_.missed,
                                        &loop_.late_wake_ups,  &loop_.exchange_overruns,
                                        &loop_.frame_overruns, &loop_.catching_up};
    std::vector<std::shared_ptr<ComponentStatistics>> components;
    if (const CycleFrames* const frames = reader_.present()) components = frames->components;
    for (const auto& component : components) counters.push_back(&component->overruns);
    std::vector<std::uint64_t> totals(counters.size());
    readSettled([&] {
        for (std::size_t i = 0; i < counters.size(); ++i) totals[i] = counters[i]->value();
    });
    for (std::size_t i = 0; i < counters.size(); ++i) counters[i]->restart(totals[i]);
    for (const auto& component : components) component->restart();
    duration_.clear();
    latency_.clear();
    lost_before_ = reader_.lost();
    lost_.store(0, std::memory_order_relaxed);
}

}  // namespace rtcf::executor
