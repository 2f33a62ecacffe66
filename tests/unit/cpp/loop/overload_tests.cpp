#include "loop/overload.hpp"

#include <gtest/gtest.h>

#include <cstdint>

namespace rtcf {
namespace {

using executor::kSecond;

constexpr std::int64_t kMillisecond = 1'000'000;

// A loop whose cycles begin at multiples of its period, as with the overrun policy `skip`.
class SimulatedLoop {
   public:
    explicit SimulatedLoop(std::int64_t period_ns) : period_ns_(period_ns) {}

    // Runs one cycle that is awake for some time. @return its rest, ns
    std::int64_t run(std::int64_t awake_ns) {
        const std::int64_t end = wake_ns_ + awake_ns;
        const std::int64_t rest = overload_.rest(wake_ns_, end, awake_ns >= period_ns_);
        awake_in_all_ns_ += awake_ns;
        wake_ns_ = ((end + rest) / period_ns_ + 1) * period_ns_;
        return rest;
    }
    std::int64_t now() const { return wake_ns_; }
    double awake() const {
        return static_cast<double>(awake_in_all_ns_) / static_cast<double>(wake_ns_ - kBegin);
    }

   private:
    static constexpr std::int64_t kBegin = 1'000 * kMillisecond;
    const std::int64_t period_ns_;
    std::int64_t wake_ns_ = kBegin;
    std::int64_t awake_in_all_ns_ = 0;
    executor::Overload overload_;
};

TEST(Overload, LeavesAQuarterOfTheCpuAfterASecond) {
    for (const std::int64_t awake : {2'500'000LL, 1'999'000LL, 9'990'000LL, 99'990'000LL}) {
        SimulatedLoop loop(kMillisecond);
        const std::int64_t begin = loop.now();
        while (loop.run(awake) == 0) ASSERT_LT(loop.now(), 10 * kSecond);
        EXPECT_GT(loop.now() - begin, kSecond / 2);
        EXPECT_LT(loop.now() - begin, 7 * kSecond / 2);
        for (int i = 0; i < 20'000; ++i) loop.run(awake);
        EXPECT_LT(loop.awake(), 0.77);
        EXPECT_GT(loop.awake(), 0.7);
    }
}

// A component with a long calculation runs in every other cycle.
TEST(Overload, CountsLateCyclesBetweenOthers) {
    SimulatedLoop loop(kMillisecond);
    for (int i = 0; i < 20'000; ++i) {
        loop.run(49'900'000);
        EXPECT_EQ(loop.run(500'000), 0) << "in time";
    }
    EXPECT_LT(loop.awake(), 0.82);
}

TEST(Overload, EndsWithCyclesInTime) {
    SimulatedLoop loop(kMillisecond);
    for (int i = 0; i < 2000; ++i) loop.run(1'999'000);
    for (int i = 0; i < 1000; ++i) EXPECT_EQ(loop.run(500'000), 0);
    EXPECT_EQ(loop.run(1'100'000), 0) << "one late cycle";
}

TEST(Overload, IsNoMatterOfCyclesInTimeNorOfLateOnesWithSleepBetween) {
    SimulatedLoop full(kMillisecond);
    for (int i = 0; i < 100'000; ++i)
        EXPECT_EQ(full.run(i % 10 == 0 ? 1'100'000 : 950'000), 0) << i;
    SimulatedLoop late(kMillisecond);
    for (int i = 0; i < 100'000; ++i) EXPECT_EQ(late.run(1'490'000), 0) << "asleep for a quarter";
}

TEST(Overload, IsNoMatterOfOneLongFreeze) {
    SimulatedLoop loop(kMillisecond);
    for (int i = 0; i < 1000; ++i) EXPECT_EQ(loop.run(500'000), 0);
    EXPECT_EQ(loop.run(3'600'000 * kMillisecond), 0);
    for (int i = 0; i < 100; ++i) EXPECT_EQ(loop.run(1'999'000), 0);
}

TEST(Overload, RestsNoLongerThanAStopMayWait) {
    SimulatedLoop loop(kMillisecond);
    for (int i = 0; i < 100; ++i) loop.run(10'000 * kMillisecond);
    EXPECT_EQ(loop.run(10'000 * kMillisecond), executor::Overload::kLongestRest);
}

}  // namespace
}  // namespace rtcf
