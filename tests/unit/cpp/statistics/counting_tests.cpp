#include "statistics/counting.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <thread>

#include "statistics/counter.hpp"

namespace rtcf::test {
namespace {

using executor::Counter;
using executor::Counting;

TEST(Counting, IsReadBetweenTurns) {
    Counting counting;
    EXPECT_TRUE(counting.read([] {}));
    {
        const Counting::Turn turn(counting);
        EXPECT_TRUE(counting.counts());
        EXPECT_FALSE(counting.read([] { FAIL() << "in a turn"; }));
    }
    EXPECT_FALSE(counting.counts());
    EXPECT_TRUE(counting.read([] {}));
}

TEST(Counting, IsReadAgainIfATurnBeganMeanwhile) {
    Counting counting;
    EXPECT_FALSE(counting.read([&] { const Counting::Turn turn(counting); }));
    std::optional<Counting::Turn> turn;
    EXPECT_FALSE(counting.read([&] { turn.emplace(counting); }));
}

TEST(Counting, TurnsThatStartWhileItIsHeldDoNotCount) {
    Counting counting;
    {
        const Counting::Turn begun(counting);
        counting.hold();
        EXPECT_TRUE(counting.counts()) << "the turn continues";
        EXPECT_FALSE(counting.read([] {}));
    }
    {
        const Counting::Turn turn(counting);
        EXPECT_FALSE(counting.counts());
        EXPECT_TRUE(counting.read([] {}));
        counting.release();
        EXPECT_FALSE(counting.counts()) << "a turn counts completely or not at all";
    }
    const Counting::Turn turn(counting);
    EXPECT_TRUE(counting.counts());
}

// Consecutive turns without a pause, as in a loop that is always late.
TEST(Counting, AllCountersAreOfTheSameTurns) {
    Counting counting;
    std::array<Counter, 64> counters;
    std::atomic<bool> ends{false};
    std::thread cycles([&] {
        while (!ends.load()) {
            const Counting::Turn turn(counting);
            if (!counting.counts()) continue;
            for (Counter& counter : counters) counter.add(1);
        }
    });
    for (int i = 0; i < 200; ++i) {
        counting.hold();
        std::array<std::uint64_t, 64> seen{};
        while (!counting.read([&] {
            for (std::size_t k = 0; k < seen.size(); ++k) seen[k] = counters[k].value();
        })) {
        }
        counting.release();
        for (const std::uint64_t each : seen) ASSERT_EQ(each, seen[0]);
        while (counters[0].value() == seen[0]) std::this_thread::yield();
    }
    ends = true;
    cycles.join();
}

}  // namespace
}  // namespace rtcf::test
