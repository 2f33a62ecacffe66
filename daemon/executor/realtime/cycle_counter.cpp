#include "realtime/cycle_counter.hpp"

namespace rtcf::executor {

namespace {

struct Pair {
    std::int64_t ns;
    std::int64_t ticks;
};

// Reads both clocks at one time: the fastest of several readings.
Pair readBoth() {
    Pair best{};
    std::int64_t best_gap = INT64_MAX;
    for (int i = 0; i < 16; ++i) {
        const std::int64_t before = readCycleCounter();
        const std::int64_t ns = monotonicNow();
        const std::int64_t after = readCycleCounter();
        if (after - before < best_gap) {
            best_gap = after - before;
            best = {ns, before + (after - before) / 2};
        }
    }
    return best;
}

}  // namespace

std::int64_t realtimeOffset(ClockReading monotonic, ClockReading realtime) noexcept {
    std::int64_t best = 0;
    std::int64_t best_gap = INT64_MAX;
    for (int i = 0; i < 8; ++i) {
        const std::int64_t before = monotonic();
        const std::int64_t now = realtime();
        const std::int64_t gap = monotonic() - before;
        if (gap >= best_gap) continue;
        best_gap = gap;
        best = now - (before + gap / 2);
    }
    return best;
}

CycleCounter CycleCounter::calibrate() {
    const Pair begin = readBoth();
    timespec pause{0, 20'000'000};
    nanosleep(&pause, nullptr);
    const Pair end = readBoth();
    CycleCounter counter;
    counter.ns_per_tick_ =
        static_cast<double>(end.ns - begin.ns) / static_cast<double>(end.ticks - begin.ticks);
    const auto one = static_cast<double>(std::int64_t{1} << kShift);
    counter.multiplier_ = static_cast<std::int64_t>(counter.ns_per_tick_ * one);
    counter.inverse_ = static_cast<std::int64_t>(one / counter.ns_per_tick_);
    return counter;
}

}  // namespace rtcf::executor
