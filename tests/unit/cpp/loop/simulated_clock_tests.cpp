// How many cycles the ticks of a simulated clock make, and at which times.
#include <gtest/gtest.h>

#include <cstring>
#include <optional>
#include <vector>

#include "bridge/injector.hpp"
#include "loop/simulated_clock.hpp"
#include "rtcf/component.hpp"

namespace rtcf::test {
namespace {

using executor::Injector;
using executor::SimulatedClock;
using Times = std::vector<std::int64_t>;
constexpr std::int64_t kMillisecond = 1'000'000;
constexpr std::int64_t kNoJump = INT64_MAX;

// All cycles that are due by the ticks so far.
Times due(SimulatedClock& clock, std::int64_t period) {
    Times times;
    while (const auto time = clock.next(period, std::chrono::milliseconds(0)))
        times.push_back(*time);
    return times;
}

TEST(SimulatedClock, BeginsWithOneCycleAtItsFirstTick) {
    SimulatedClock clock;
    clock.reset(kNoJump);
    clock.tick(5000);
    EXPECT_EQ(due(clock, 10), Times{5000});
    const auto jump = clock.takeJump();
    ASSERT_TRUE(jump);
    EXPECT_FALSE(jump->from_ns);
    EXPECT_EQ(jump->to_ns, 5000);
    EXPECT_FALSE(clock.takeJump());
}

TEST(SimulatedClock, MakesACycleForEachWholePeriod) {
    SimulatedClock clock;
    clock.reset(kNoJump);
    clock.tick(100);
    clock.tick(135);
    EXPECT_EQ(due(clock, 10), (Times{100, 110, 120, 130}));
    clock.tick(139);
    EXPECT_EQ(due(clock, 10), Times{});
    clock.tick(140);
    EXPECT_EQ(due(clock, 10), Times{140});
    clock.tick(140);  // a clock that stands still
    EXPECT_EQ(due(clock, 10), Times{});
}

TEST(SimulatedClock, LosesNoCycleWhateverTheRateOfTheClock) {
    constexpr std::int64_t kSpan = 10'000 * kMillisecond;
    for (const std::int64_t rate : {100, 999, 1001, 7}) {
        SimulatedClock clock;
        clock.reset(kNoJump);
        std::size_t cycles = 0;
        for (std::int64_t tick = 0; tick <= rate * 10; ++tick) {
            clock.tick(tick * 1'000'000'000 / rate);
            cycles += due(clock, kMillisecond).size();
        }
        EXPECT_EQ(cycles, kSpan / kMillisecond + 1) << rate << " Hz";
    }
}

TEST(SimulatedClock, GoesOnFromAJumpWithOneCycle) {
    SimulatedClock clock;
    clock.reset(100);
    clock.tick(1000);
    clock.tick(1100);  // no jump yet
    EXPECT_EQ(due(clock, 50), (Times{1000, 1050, 1100}));
    clock.tick(1201);
    EXPECT_EQ(due(clock, 50), Times{1201});
    clock.tick(20);
    clock.tick(75);
    EXPECT_EQ(due(clock, 50), (Times{20, 70}));
    std::vector<std::int64_t> to;
    while (const auto jump = clock.takeJump()) to.push_back(jump->to_ns);
    EXPECT_EQ(to, (Times{1000, 1201, 20}));
    EXPECT_EQ(clock.now(), 75);
}

TEST(SimulatedClock, ForgetsItsTicksWhenItBeginsAnew) {
    SimulatedClock clock;
    clock.reset(kNoJump);
    clock.tick(1000);
    clock.reset(kNoJump);
    EXPECT_EQ(due(clock, 10), Times{});
    EXPECT_FALSE(clock.takeJump());
    EXPECT_FALSE(clock.now());
}

class QueueingInjector : public ::testing::Test {
   protected:
    void deliver(double value) {
        std::vector<std::uint8_t> bytes(sizeof value);
        std::memcpy(bytes.data(), &value, sizeof value);
        injector_.deliver(bytes.data(), sizeof value);
    }
    // What a cycle sees; nothing if it is nothing new.
    std::optional<double> cycle() {
        injector_.deliverNext();
        if (!injector_.adopt(clock_)) return {};
        return static_cast<const Slot<double>*>(injector_.front())->value;
    }

    Injector injector_{"/x", typeInfo<double>()};
    LoopClock clock_{};
};

TEST_F(QueueingInjector, GivesEachCycleOneValue) {
    injector_.setQueueing(true);
    for (const double value : {1.0, 2.0, 3.0}) deliver(value);
    EXPECT_EQ(cycle(), 1.0);
    EXPECT_EQ(cycle(), 2.0);
    EXPECT_EQ(cycle(), 3.0);
    EXPECT_EQ(cycle(), std::nullopt);
}

TEST_F(QueueingInjector, GivesTheNewestOnceItQueuesNoMore) {
    injector_.setQueueing(true);
    for (const double value : {1.0, 2.0, 3.0}) deliver(value);
    EXPECT_EQ(cycle(), 1.0);
    injector_.setQueueing(false);
    EXPECT_EQ(cycle(), 3.0);
    deliver(4.0);
    deliver(5.0);
    EXPECT_EQ(cycle(), 5.0);
}

}  // namespace
}  // namespace rtcf::test
