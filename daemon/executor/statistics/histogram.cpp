#include "statistics/histogram.hpp"

#include <algorithm>
#include <cmath>

namespace rtcf::executor {

Histogram::~Histogram() {
    for (const std::atomic<Block*>& block : blocks_) delete block.load(std::memory_order_relaxed);
}

void Histogram::allocate() {
    for (std::size_t number = 0; number < kBlocks; ++number) {
        if (blocks_[number].load(std::memory_order_relaxed) == nullptr) allocateBlock(number);
    }
}

Histogram::Block& Histogram::allocateBlock(std::size_t number) {
    auto* const block = new Block{};
    blocks_[number].store(block, std::memory_order_release);
    return *block;
}

void Histogram::clear() noexcept {
    for (const std::atomic<Block*>& place : blocks_) {
        Block* const block = place.load(std::memory_order_relaxed);
        if (block == nullptr) continue;
        for (Counter& bucket : *block) bucket.reset();
    }
    sum_.reset();
    maximum_.store(0, std::memory_order_relaxed);
    generation_.fetch_add(1, std::memory_order_relaxed);
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
    result.generation = generation_.load(std::memory_order_relaxed);
    result.sum = static_cast<std::int64_t>(sum_.value());
    result.maximum = maximum_.load(std::memory_order_relaxed);
    for (std::size_t number = 0; number < kBlocks; ++number) {
        const Block* const block = blocks_[number].load(std::memory_order_acquire);
        if (block == nullptr) continue;
        for (std::size_t i = 0; i < kInBlock; ++i) {
            const std::uint64_t count = (*block)[i].value();
            if (count == 0) continue;
            result.buckets.push_back({number * kInBlock + i, count});
            result.count += count;
        }
    }
    result.buckets.shrink_to_fit();
    return result;
}

HistogramSnapshot difference(const HistogramSnapshot& now, const HistogramSnapshot& earlier) {
    if (now.generation != earlier.generation) return now;
    HistogramSnapshot result;
    result.generation = now.generation;
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
