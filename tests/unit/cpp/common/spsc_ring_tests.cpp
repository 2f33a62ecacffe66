#include "common/spsc_ring.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <thread>

namespace rtcf::test {
namespace {

using executor::SpscRing;

TEST(SpscRing, IsFirstInFirstOut) {
    SpscRing<int, 4> ring;
    for (int round = 0; round < 10; ++round) {
        for (int i = 0; i < 3; ++i) {
            *ring.claim() = round * 10 + i;
            ring.commit();
        }
        for (int i = 0; i < 3; ++i) {
            ASSERT_NE(ring.front(), nullptr);
            EXPECT_EQ(*ring.front(), round * 10 + i);
            ring.pop();
        }
        EXPECT_EQ(ring.front(), nullptr);
    }
}

TEST(SpscRing, ClaimedElementIsNotSeenBeforeCommit) {
    SpscRing<int, 4> ring;
    *ring.claim() = 1;
    EXPECT_EQ(ring.front(), nullptr);
    ring.commit();
    EXPECT_NE(ring.front(), nullptr);
}

TEST(SpscRing, FullRingRejectsAndCounts) {
    SpscRing<int, 4> ring;
    for (int i = 0; i < 4; ++i) {
        *ring.claim() = i;
        ring.commit();
    }
    EXPECT_EQ(ring.claim(), nullptr);
    EXPECT_EQ(ring.claim(), nullptr);
    EXPECT_EQ(ring.dropped(), 2U);
    EXPECT_EQ(*ring.front(), 0) << "the content is kept";
    ring.pop();
    EXPECT_NE(ring.claim(), nullptr);
}

TEST(SpscRing, ConsumerSeesAllElementsNotDroppedInOrder) {
    constexpr std::uint64_t kCount = 200'000;
    SpscRing<std::uint64_t, 64> ring;
    std::thread producer([&ring] {
        for (std::uint64_t i = 1; i <= kCount; ++i) {
            if (std::uint64_t* item = ring.claim()) {
                *item = i;
                ring.commit();
            }
        }
    });
    std::uint64_t seen = 0;
    std::uint64_t last = 0;
    const auto take = [&] {
        while (const std::uint64_t* item = ring.front()) {
            EXPECT_GT(*item, last);
            last = *item;
            ++seen;
            ring.pop();
        }
    };
    while (last < kCount && seen + ring.dropped() < kCount) take();
    producer.join();
    take();
    EXPECT_EQ(seen + ring.dropped(), kCount);
}

}  // namespace
}  // namespace rtcf::test
