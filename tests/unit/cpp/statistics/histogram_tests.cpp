#include "statistics/histogram.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

namespace rtcf::test {
namespace {

using namespace executor;

constexpr double kError = 0.03;

TEST(Histogram, EachBucketStartsAtTheEndOfThePreviousOne) {
    for (std::size_t i = 0; i + 1 < Histogram::kBuckets; ++i) {
        ASSERT_EQ(Histogram::lowerBound(i) + Histogram::width(i), Histogram::lowerBound(i + 1))
            << i;
    }
}

TEST(Histogram, PutsBothEndsOfABucketIntoIt) {
    for (std::size_t i = 0; i < Histogram::kBuckets; ++i) {
        ASSERT_EQ(Histogram::bucketOf(Histogram::lowerBound(i)), i);
        ASSERT_EQ(Histogram::bucketOf(Histogram::lowerBound(i) + Histogram::width(i) - 1), i);
    }
}

TEST(Histogram, HasLessThan3PercentErrorUpTo10Seconds) {
    const auto ten_seconds_of_3_ghz = std::int64_t{30'000'000'000};
    for (std::size_t i = 0; Histogram::lowerBound(i) <= ten_seconds_of_3_ghz; ++i) {
        ASSERT_LT(i + 1, Histogram::kBuckets);
        const auto low = static_cast<double>(Histogram::lowerBound(i));
        const double half = 0.5 * static_cast<double>(Histogram::width(i) - 1);
        ASSERT_LE(half, kError * std::max(1.0, low));
    }
}

TEST(Histogram, AcceptsValuesOutOfRange) {
    EXPECT_EQ(Histogram::bucketOf(-5), 0U);
    EXPECT_EQ(Histogram::bucketOf(std::numeric_limits<std::int64_t>::max()),
              Histogram::kBuckets - 1);
}

// The value of rank ceil(q n), by the definition of quantiles.
double exactQuantile(const std::vector<std::int64_t>& sorted, double q) {
    const auto rank = static_cast<std::size_t>(std::ceil(q * static_cast<double>(sorted.size())));
    return static_cast<double>(sorted[rank - 1]);
}

TEST(Histogram, ReturnsTheQuantilesOfTheValues) {
    std::mt19937_64 random(1);
    for (const double spread : {0.2, 1.0, 3.0}) {
        std::lognormal_distribution<double> durations(9.0, spread);
        Histogram histogram;
        std::vector<std::int64_t> values;
        for (int i = 0; i < 20000; ++i) values.push_back(std::llround(durations(random)));
        for (const std::int64_t value : values) histogram.add(value);
        std::sort(values.begin(), values.end());
        const DistributionSummary summary = summarize(histogram.snapshot(), 1.0);
        EXPECT_EQ(summary.count, values.size());
        const auto near = [](double expected) { return kError * expected + 0.5; };
        EXPECT_NEAR(summary.min, static_cast<double>(values.front()),
                    near(static_cast<double>(values.front())));
        EXPECT_NEAR(summary.p50, exactQuantile(values, 0.5), near(exactQuantile(values, 0.5)));
        EXPECT_NEAR(summary.p99, exactQuantile(values, 0.99), near(exactQuantile(values, 0.99)));
        EXPECT_NEAR(summary.p999, exactQuantile(values, 0.999), near(exactQuantile(values, 0.999)));
        EXPECT_EQ(summary.max, static_cast<double>(values.back()));
        double sum = 0.0;
        for (const std::int64_t value : values) sum += static_cast<double>(value);
        EXPECT_NEAR(summary.mean, sum / 20000.0, 1e-6 * summary.mean);
    }
}

TEST(Histogram, OrdersItsQuantilesEvenForOneValue) {
    for (const std::int64_t value : {0, 1, 65, 97, 12345, 1'000'000'007}) {
        Histogram histogram;
        histogram.add(value);
        const DistributionSummary summary = summarize(histogram.snapshot(), 1.0);
        EXPECT_LE(summary.min, summary.p50);
        EXPECT_LE(summary.p50, summary.p99);
        EXPECT_LE(summary.p99, summary.p999);
        EXPECT_LE(summary.p999, summary.max);
        EXPECT_EQ(summary.max, static_cast<double>(value));
    }
}

TEST(Histogram, WithoutValuesIsAllZero) {
    const DistributionSummary summary = summarize(Histogram().snapshot(), 1.0);
    EXPECT_EQ(summary.count, 0U);
    EXPECT_EQ(summary.max, 0.0);
}

// Otherwise 4000 components would need 37 MB of locked memory from the first query on.
TEST(Histogram, ASnapshotStoresNoEmptyBuckets) {
    Histogram histogram;
    for (int i = 0; i < 1000; ++i) histogram.add(100 + 1'000'000 * (i % 3));
    const HistogramSnapshot snapshot = histogram.snapshot();
    EXPECT_LE(snapshot.buckets.capacity() * sizeof snapshot.buckets[0], 64U);
    histogram.add(100);
    const HistogramSnapshot since = difference(histogram.snapshot(), snapshot);
    EXPECT_LE(since.buckets.capacity() * sizeof since.buckets[0], 64U);
    EXPECT_EQ(summarize(since, 1.0).max, 100.0);
}

TEST(Histogram, ClearedHasLaterValuesOnly) {
    Histogram histogram;
    histogram.add(1'000'000);
    const HistogramSnapshot before = histogram.snapshot();
    histogram.clear();
    EXPECT_EQ(histogram.snapshot().count, 0U);
    histogram.add(40);
    const HistogramSnapshot after = histogram.snapshot();
    EXPECT_EQ(after.count, 1U);
    EXPECT_EQ(after.maximum, 40);
    EXPECT_EQ(difference(after, before).count, 1U) << "of the values since it was cleared";
    EXPECT_EQ(difference(after, before).sum, 40);
}

TEST(Histogram, CountsTheSameWithMemoryForAllValues) {
    std::mt19937_64 random(2);
    std::lognormal_distribution<double> durations(9.0, 3.0);
    Histogram sparse;
    Histogram full;
    full.allocate();
    for (int i = 0; i < 1000; ++i) {
        const std::int64_t value = std::llround(durations(random));
        sparse.add(value);
        full.add(value);
    }
    const HistogramSnapshot some = sparse.snapshot();
    const HistogramSnapshot all = full.snapshot();
    ASSERT_EQ(some.buckets.size(), all.buckets.size());
    for (std::size_t i = 0; i < some.buckets.size(); ++i) {
        EXPECT_EQ(some.buckets[i].number, all.buckets[i].number);
        EXPECT_EQ(some.buckets[i].count, all.buckets[i].count);
    }
    EXPECT_EQ(some.sum, all.sum);
    EXPECT_EQ(some.maximum, all.maximum);
}

TEST(Histogram, ScalesItsResults) {
    Histogram histogram;
    histogram.add(40);
    const DistributionSummary summary = summarize(histogram.snapshot(), 0.5);
    EXPECT_DOUBLE_EQ(summary.p50, 20.0);
    EXPECT_DOUBLE_EQ(summary.mean, 20.0);
    EXPECT_DOUBLE_EQ(summary.max, 20.0);
}

TEST(HistogramDifference, CountsLaterValues) {
    Histogram histogram;
    for (int i = 0; i < 100; ++i) histogram.add(1000);
    const HistogramSnapshot before = histogram.snapshot();
    for (int i = 0; i < 10; ++i) histogram.add(10);
    const DistributionSummary since = summarize(difference(histogram.snapshot(), before), 1.0);
    EXPECT_EQ(since.count, 10U);
    EXPECT_DOUBLE_EQ(since.mean, 10.0);
    EXPECT_DOUBLE_EQ(since.p999, 10.0);
    EXPECT_DOUBLE_EQ(since.max, 10.0) << "the older maximum is excluded";
}

TEST(HistogramDifference, ToAnEmptyHistogramIsEverything) {
    Histogram histogram;
    histogram.add(5);
    EXPECT_EQ(difference(histogram.snapshot(), {}).count, 1U);
}

}  // namespace
}  // namespace rtcf::test
