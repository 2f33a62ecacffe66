/// @file
/// The durations of a loop's cycles and of its components, and its wake-up latencies, as
/// histograms. Counted from frames after the cycles, so that they cost the loop nothing.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>

#include "loop/cycle.hpp"
#include "loop/cycle_reader.hpp"
#include "statistics/histogram.hpp"

namespace rtcf::executor {

/// Owned by the runner. Any thread.
class CycleStatistics {
   public:
    /// @param loop counters of the loop, which restart with these statistics; outlive this object
    explicit CycleStatistics(LoopStatistics& loop) : loop_(loop) {}

    /// Adds the frames of the next graph. After the loop has begun to fill them.
    void follow(const CycleFrames& frames);
    /// Counts the cycles since the last call, except for those of the warm-up.
    /// @return share of the ring that they filled; above 1, cycles were lost
    double count();
    /// Number of cycles that the present frames hold.
    std::size_t capacity();
    /// Resets the statistics of the loop and of the present components.
    void restart();
    /// Counts, and lets both functions copy statistics of the same cycles, unless the loop leaves
    /// no time for it.
    /// @param counters   copies counters of LoopStatistics and ComponentStatistics; may be called
    /// again
    /// @param histograms copies histograms
    template <typename Counters, typename Histograms>
    void read(Counters&& counters, Histograms&& histograms) {
        const std::lock_guard<std::mutex> lock(mutex_);
        readSettled(counters);
        histograms();
    }

    const Histogram& duration() const noexcept { return duration_; }  ///< ticks
    const Histogram& latency() const noexcept { return latency_; }    ///< ns
    /// Cycles since the last restart that are not counted, because their frames were overwritten.
    std::uint64_t lost() const noexcept { return lost_.load(std::memory_order_relaxed); }

   private:
    std::uint64_t countFrames();
    void add(const CycleFrames& frames);
    template <typename Counters>
    void readSettled(Counters&& counters) {
        constexpr int kAttempts = 100;
        for (int i = 0; i < kAttempts; ++i) {
            const auto count = [&] {
                countFrames();
                counters();
            };
            const CycleFrames* const frames = reader_.present();
            if (frames != nullptr && frames->ring->ifSettled(count)) return;
        }
        countFrames();
        counters();
    }

    LoopStatistics& loop_;
    std::mutex mutex_;  // protects the following; the histograms can be read without it
    CycleReader reader_;
    Frame frame_;
    std::uint64_t lost_before_ = 0;  // CycleReader::lost() at the last restart
    Histogram duration_;
    Histogram latency_;
    std::atomic<std::uint64_t> lost_{0};
};

}  // namespace rtcf::executor
