#include "statistics/histogram.hpp"

#include <algorithm>
#include <cmath>

namespace rtcf::executor {

void Histogram::addLarge(std::int64_t value) noexcept RTCF_NONBLOCKING {
    buckets_[bucketOf(value)].add(1);
    if (value < 0) return;
    large_sum_.add(static_cast<std::uint64_t>(value));
    if (value > maximum_.load(std::memory_order_relaxed))
        maximum_.store(value, std::memory_order_relaxed);
}

std::int64_t Histogram::lowerBound(std::size_t bucket) noexcept {
    if (bucket < kExact) return static_cast<std::int64_t>(bucket);
    const std::size_t octave = (bucket - kExact) >> kSubBits;
    const std::size_t within = (bucket - kExact) & ((std::size_t{1} << kSubBits) - 1);
    return static_cast<std::int64_t>(((std::size_t{1} << kSubBits) + within)
                                     << (octave + kExactBits - kSubBits));
}

std::int64_t Histogram::width(std::size_t bucket) noexcept {
    if (bucket < kExact) return 1;
    return std::int64_t{1} << (((bucket - kExact) >> kSubBits) + kExactBits - kSubBits);
}

HistogramSnapshot Histogram::snapshot() const {
    HistogramSnapshot result;
    result.buckets.reserve(kBuckets);
    result.sum = static_cast<std::int64_t>(large_sum_.value());
    result.maximum = maximum_.load(std::memory_order_relaxed);
    for (const Counter& bucket : buckets_) {
        const std::size_t index = result.buckets.size();
        const std::uint64_t count = bucket.value();
        result.buckets.push_back(count);
        result.count += count;
        if (index >= kExact || count == 0) continue;
        const auto value = static_cast<std::int64_t>(index);
        result.sum += value * static_cast<std::int64_t>(count);
        result.maximum = std::max(result.maximum, value);
    }
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
    const double maximum = Histogram::bucketOf(snapshot.maximum) == top
                               ? static_cast<double>(snapshot.maximum)
                               : middle(top);
    const auto quantile = [&](double q) {
        const auto rank =
            static_cast<std::uint64_t>(std::ceil(q * static_cast<double>(snapshot.count)));
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
