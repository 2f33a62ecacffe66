#include "runner/spin_tuner.hpp"

#include <algorithm>

#include "common/time_units.hpp"

namespace rtcf::executor {

void SpinTuner::tune(Loop& loop, std::int64_t period_ns) {
    const std::int64_t now_ns = monotonicNow();
    if (now_ns - tuned_at_ns_ < kSecond) return;
    const HistogramSnapshot now = loop.statistics().wake_up.snapshot();
    const DistributionSummary late = summarize(difference(now, measured_), 1.0);
    measured_ = now;
    tuned_at_ns_ = now_ns;
    if (late.count == 0) return;
    spin_ns_ = std::min(static_cast<std::int64_t>(late.p99), period_ns / 10);
    loop.setSpin(*spin_ns_);
}

}  // namespace rtcf::executor
