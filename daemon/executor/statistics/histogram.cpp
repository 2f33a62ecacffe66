#include "statistics/histogram.hpp"

#include <algorithm>
#include <cmath>

namespace rtcf::executor {

std::int64_t Histogram::lowerBound(std::size_t bucket) noexcept {
    const std::size_t octave = bucket >> kSubBits;
    if (octave <= 1) return static_cast<std::int64_t>(bucket);
    const std::size_t within = bucket - ((octave - 1) << kSubBits);
    return static_cast<std::int64_t>(within << (octave - 1));
}

std::int64_t Histogram::width(std::size_t bucket) noexcept {
    const std::size_t octave = bucket >> kSubBits;
    return octave <= 1 ? 1 : std::int64_t{1} << (octave - 1);
}

HistogramSnapshot Histogram::snapshot() const {
    HistogramSnapshot result;
    result.buckets.reserve(kBuckets);
    for (const auto& bucket : buckets_) {
        result.buckets.push_back(bucket.load(std::memory_order_relaxed));
        result.count += result.buckets.back();
    }
    result.sum = sum_.load(std::memory_order_relaxed);
    result.maximum = maximum_.load(std::memory_order_relaxed);
    return result;
}

HistogramSnapshot difference(const HistogramSnapshot& now, const HistogramSnapshot& earlier) {
    HistogramSnapshot result = now;
    if (earlier.buckets.empty()) return result;
    result.count -= earlier.count;
    result.sum -= earlier.sum;
    for (std::size_t i = 0; i < result.buckets.size(); ++i) result.buckets[i] -= earlier.buckets[i];
    return result;
}

DistributionSummary summarize(const HistogramSnapshot& snapshot, double scale) {
    DistributionSummary result;
    result.count = snapshot.count;
    if (snapshot.count == 0) return result;
    const auto middle = [](std::size_t bucket) {
        return static_cast<double>(Histogram::lowerBound(bucket)) +
               0.5 * static_cast<double>(Histogram::width(bucket) - 1);
    };
    // The exact maximum may be older than what is summarised: it counts only in the top bucket.
    std::size_t top = 0;
    std::size_t bottom = snapshot.buckets.size();
    for (std::size_t i = 0; i < snapshot.buckets.size(); ++i) {
        if (snapshot.buckets[i] == 0) continue;
        top = i;
        bottom = std::min(bottom, i);
    }
    const double maximum = Histogram::bucketOf(snapshot.maximum) == top ? static_cast<double>(snapshot.maximum)
                                                                        : middle(top);
    const auto quantile = [&](double q) {
        const auto rank = static_cast<std::uint64_t>(std::ceil(q * static_cast<double>(snapshot.count)));
        std::uint64_t below = 0;
        for (std::size_t i = bottom; i <= top; ++i) {
            below += snapshot.buckets[i];
            if (below >= rank) return std::min(middle(i), maximum);
        }
        return maximum;
    };
    result.min = std::min(middle(bottom), maximum) * scale;
    result.mean = static_cast<double>(snapshot.sum) / static_cast<double>(snapshot.count) * scale;
    result.p50 = quantile(0.5) * scale;
    result.p99 = quantile(0.99) * scale;
    result.p999 = quantile(0.999) * scale;
    result.max = maximum * scale;
    return result;
}

}  // namespace rtcf::executor
