/// @file
/// A histogram of durations: small values one by one, larger ones in
/// logarithmic octaves of linear buckets (as in HdrHistogram, G. Tene). Fixed
/// memory, relative error below 1.6 %. One thread adds in constant time; any
/// other reads snapshots, and resets by subtracting an earlier snapshot, so
/// that the writer is never disturbed.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <vector>

#include "rtcf/realtime.hpp"
#include "statistics/counter.hpp"

namespace rtcf::executor {

/// A histogram's counts at one time. Values are in the writer's unit.
struct HistogramSnapshot {
    struct Bucket {
        std::size_t number;
        std::uint64_t count;
    };
    /// Those with values, from the smallest on: the others are most, and snapshots are kept.
    std::vector<Bucket> buckets;
    std::uint64_t count = 0;
    std::int64_t sum = 0;
    std::int64_t maximum = 0;  ///< exact, since the beginning
};

/// Figures drawn from a snapshot, in the unit of its values times a scale.
struct DistributionSummary {
    std::uint64_t count = 0;
    double min = 0.0;
    double mean = 0.0;
    double p50 = 0.0;
    double p99 = 0.0;
    double p999 = 0.0;
    double max = 0.0;
};

/// What was added between two snapshots; `earlier` may be empty.
HistogramSnapshot difference(const HistogramSnapshot& now, const HistogramSnapshot& earlier);

/// Minimum, mean, quantiles, maximum. @param scale multiplies every value, e.g. ns per tick
DistributionSummary summarize(const HistogramSnapshot& snapshot, double scale);

class Histogram {
   public:
    static constexpr unsigned kExactBits = 8;
    static constexpr std::size_t kExact = std::size_t{1}
                                          << kExactBits;  // values with a bucket each
    static constexpr unsigned kSubBits = 5;               // 32 buckets an octave from there
    static constexpr unsigned kOctaves = 28;  // up to 2^36 units: 23 s of a 3 GHz counter
    static constexpr std::size_t kBuckets = kExact + (std::size_t{kOctaves} << kSubBits);

    /// Adds a value; below 0 counts as 0, above the range as the last bucket. Real-time safe.
    /// A short update() takes a few hundred ticks: those values, which are their own bucket, cost
    /// one addition, as their sum and maximum follow from the buckets.
    void add(std::int64_t value) noexcept RTCF_NONBLOCKING {
        if (static_cast<std::uint64_t>(value) < kExact) {
            buckets_[static_cast<std::size_t>(value)].add(1);
        } else {
            addLarge(value);
        }
    }

    /// Any thread; not real-time safe. Counts of a running writer may differ by the last few
    /// values.
    HistogramSnapshot snapshot() const;

    static std::size_t bucketOf(std::int64_t value) noexcept {
        const auto v = static_cast<std::uint64_t>(value < 0 ? 0 : value);
        if (v < kExact) return v;
        const unsigned magnitude = 63U - static_cast<unsigned>(__builtin_clzll(v));
        const std::size_t within = (v >> (magnitude - kSubBits)) - (std::uint64_t{1} << kSubBits);
        const std::size_t index =
            kExact + (static_cast<std::size_t>(magnitude - kExactBits) << kSubBits) + within;
        return index < kBuckets ? index : kBuckets - 1;
    }
    /// Smallest value of a bucket, and the number of values it holds.
    static std::int64_t lowerBound(std::size_t bucket) noexcept;
    static std::int64_t width(std::size_t bucket) noexcept;

   private:
    void addLarge(std::int64_t value) noexcept RTCF_NONBLOCKING;

    std::array<Counter, kBuckets> buckets_{};
    // Of the values from kExact on.
    Counter large_sum_;
    std::atomic<std::int64_t> maximum_{0};
};

}  // namespace rtcf::executor
