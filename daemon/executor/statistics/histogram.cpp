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
    result.buckets.reserve(static_cast<std::size_t>(
        std::count_if(buckets_.begin(), buckets_.end(),
                      [](const Counter& bucket) { return bucket.value() != 0; })));
    result.sum = static_cast<std::int64_t>(large_sum_.value());
    result.maximum = maximum_.load(std::memory_order_relaxed);
    for (std::size_t number = 0; number < kBuckets; ++number) {
        const std::uint64_t count = buckets_[number].value();
        if (count == 0) continue;
        result.buckets.push_back({number, count});
        result.count += count;
        if (number >= kExact) continue;
        const auto value = static_cast<std::int64_t>(number);
        result.sum += value * static_cast<std::int64_t>(count);
        result.maximum = std::max(result.maximum, value);
    }
    return result;
}

HistogramSnapshot difference(const HistogramSnapshot& now, const HistogramSnapshot& earlier) {
    HistogramSnapshot result;
    result.count = now.count - earlier.count;
    result.sum = now.sum - earlier.sum;
    result.maximum = now.maximum;
    auto before = earlier.buckets.begin();
    for (const HistogramSnapshot::Bucket& bucket : now.buckets) {
        while (before != earlier.buckets.end() && before->number < bucket.number) ++before;
        const bool both = before != earlier.buckets.end() && before->number == bucket.number;
        const std::uint64_t since = bucket.count - (both ? before->count : 0);
        if (since != 0) result.buckets.push_back({bucket.number, since});
    }
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
    if (snapshot.buckets.empty()) return result;
    const std::size_t bottom = snapshot.buckets.front().number;
    const std::size_t top = snapshot.buckets.back().number;
    // The exact maximum may be older than the values in the snapshot, so it is used only if it is
    // in the top bucket.
    const double maximum = Histogram::bucketOf(snapshot.maximum) == top
                               ? static_cast<double>(snapshot.maximum)
                               : middle(top);
    const auto quantile = [&](double q) {
        const auto rank =
            static_cast<std::uint64_t>(std::ceil(q * static_cast<double>(snapshot.count)));
        std::uint64_t below = 0;
        for (const HistogramSnapshot::Bucket& bucket : snapshot.buckets) {
            below += bucket.count;
            if (below >= rank) return std::min(middle(bucket.number), maximum);
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
