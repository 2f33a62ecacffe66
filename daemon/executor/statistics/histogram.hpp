/// @file
/// A histogram of durations: one bucket per small value, and logarithmic octaves of linear buckets
/// for larger ones (as in HdrHistogram, G. Tene), with a relative error below 1.6 %. Only the
/// octaves that have values take memory. One thread adds values; any thread takes snapshots.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "rtcf/realtime.hpp"
#include "statistics/counter.hpp"

namespace rtcf::executor {

/// Counts of a histogram at one time. Values are in the writer's unit.
struct HistogramSnapshot {
    struct Bucket {
        std::size_t number;
        std::uint64_t count;
    };
    /// Non-empty buckets in ascending order. Most buckets are empty, and snapshots are kept in
    /// memory.
    std::vector<Bucket> buckets;
    std::uint64_t count = 0;
    std::int64_t sum = 0;
    std::int64_t maximum = 0;      ///< exact; since the histogram was created or cleared
    std::uint64_t generation = 0;  ///< how often the histogram was cleared
};

/// Statistics of a snapshot, in the unit of its values times a scale.
struct DistributionSummary {
    std::uint64_t count = 0;
    double min = 0.0;
    double mean = 0.0;
    double p50 = 0.0;
    double p99 = 0.0;
    double p999 = 0.0;
    double max = 0.0;
};

/// The values added between two snapshots; `earlier` may be empty. If the histogram was cleared in
/// between, all values of `now`.
HistogramSnapshot difference(const HistogramSnapshot& now, const HistogramSnapshot& earlier);

/// Computes minimum, mean, quantiles and maximum.
/// @param scale factor for every value, e.g. ns per tick
DistributionSummary summarize(const HistogramSnapshot& snapshot, double scale);

class Histogram {
   public:
    static constexpr unsigned kExactBits = 8;
    static constexpr std::size_t kExact = std::size_t{1} << kExactBits;  // values with own buckets
    static constexpr unsigned kSubBits = 5;   // 32 buckets per octave above them
    static constexpr unsigned kOctaves = 28;  // up to 2^36 units: 23 s of a 3 GHz counter
    static constexpr std::size_t kBuckets = kExact + (std::size_t{kOctaves} << kSubBits);

    Histogram() = default;
    ~Histogram();
    Histogram(const Histogram&) = delete;
    Histogram& operator=(const Histogram&) = delete;

    /// Allocates the memory for all values, so that add() allocates nothing.
    void allocate();
    /// Adds a value. Negative values count as 0; values above the range count in the last bucket.
    /// Writer only. Real-time safe after allocate().
    void add(std::int64_t value) {
        const std::size_t number = bucketOf(value);
        Block* block = blocks_[number / kInBlock].load(std::memory_order_relaxed);
        if (block == nullptr) block = &allocateBlock(number / kInBlock);
        (*block)[number % kInBlock].add(1);
        if (value < 0) return;
        sum_.add(static_cast<std::uint64_t>(value));
        if (value > maximum_.load(std::memory_order_relaxed))
            maximum_.store(value, std::memory_order_relaxed);
    }
    /// Removes all values. Writer only.
    void clear() noexcept;

    /// Copies the counts. While the writer runs, the last few values may be missing in some of
    /// them. Any thread; not real-time safe.
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
    /// Smallest value of a bucket, and the number of different values in it.
    static std::int64_t lowerBound(std::size_t bucket) noexcept;
    static std::int64_t width(std::size_t bucket) noexcept;

   private:
    static constexpr std::size_t kInBlock = std::size_t{1} << kSubBits;
    static constexpr std::size_t kBlocks = kBuckets / kInBlock;
    using Block = std::array<Counter, kInBlock>;

    Block& allocateBlock(std::size_t number);

    std::array<std::atomic<Block*>, kBlocks> blocks_{};  // owned; null = no values
    Counter sum_;
    std::atomic<std::int64_t> maximum_{0};
    std::atomic<std::uint64_t> generation_{0};
};

}  // namespace rtcf::executor
