/// @file
/// Adjusts the spin time of a loop to its wake-up latency, for the setting spin = auto. Owned by
/// LoopControl; graph thread.
#pragma once

#include <cstdint>
#include <optional>

#include "loop/loop.hpp"
#include "statistics/histogram.hpp"

namespace rtcf::executor {

class SpinTuner {
   public:
    /// Sets the loop's spin time to the 99 % quantile of the wake-up latency of the last second, at
    /// most a tenth of the period. Called periodically; works once per second.
    void tune(Loop& loop, std::int64_t period_ns);
    /// Forgets the result: the loop has the spin time of its settings again.
    void reset() noexcept { spin_ns_.reset(); }
    /// The result, ns; none before the first one.
    std::optional<std::int64_t> spin() const noexcept { return spin_ns_; }

   private:
    std::optional<std::int64_t> spin_ns_;
    HistogramSnapshot measured_;  // wake-up latency at the last tune()
    std::int64_t tuned_at_ns_ = 0;
};

}  // namespace rtcf::executor
