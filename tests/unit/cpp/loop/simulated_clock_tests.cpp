// The number and the times of cycles for the ticks of a simulated clock.
#include <gtest/gtest.h>

#include <cstring>
#include <optional>
#include <vector>

#include "exchange/injector.hpp"
#include "loop/simulated_clock.hpp"
#include "rtcf/component.hpp"

namespace rtcf::test {
namespace {

using executor::Injector;
using executor::SimulatedClock;
using Times = std::vector<std::int64_t>;
constexpr std::int64_t kMillisecond = 1'000'000;
constexpr std::int64_t kNoJump = INT64_MAX;

// All cycles due for the ticks so far.
Times due(SimulatedClock& clock, std::int64_t period) {
    Times times;
    while (const auto time = clock.next(period, std::chrono::milliseconds(0)))
        times.push_back(time->time_ns);
    return times;
}

TEST(SimulatedClock, BeginsWithOneCycleAtItsFirstTick) {
    SimulatedClock clock;
    clock.reset(kNoJump);
    clock.tick(5000, 0);
    EXPECT_EQ(due(clock, 10), Times{5000});
    const auto jump = clock.takeJump();
    ASSERT_TRUE(jump);
    EXPECT_FALSE(jump->from_ns);
    EXPECT_EQ(jump->to_ns, 5000);
    EXPECT_FALSE(clock.takeJump());
}

TEST(SimulatedClock, RunsACycleForEachWholePeriod) {
    SimulatedClock clock;
    clock.reset(kNoJump);
    clock.tick(100, 0);
    clock.tick(135, 0);
    EXPECT_EQ(due(clock, 10), (Times{100, 110, 120, 130}));
    clock.tick(139, 0);
    EXPECT_EQ(due(clock, 10), Times{});
    clock.tick(140, 0);
    EXPECT_EQ(due(clock, 10), Times{140});
    clock.tick(140, 0);  // a stopped clock
    EXPECT_EQ(due(clock, 10), Times{});
}

TEST(SimulatedClock, LosesNoCycleAtAnyRateOfTheClock) {
    constexpr std::int64_t kSpan = 10'000 * kMillisecond;
    for (const std::int64_t rate : {100, 999, 1001, 7}) {
        SimulatedClock clock;
        clock.reset(kNoJump);
        std::size_t cycles = 0;
        for (std::int64_t tick = 0; tick <= rate * 10; ++tick) {
            clock.tick(tick * 1'000'000'000 / rate, 0);
            cycles += due(clock, kMillisecond).size();
        }
        EXPECT_EQ(cycles, kSpan / kMillisecond + 1) << rate << " Hz";
    }
}

TEST(SimulatedClock, ContinuesAfterAJumpWithOneCycle) {
    SimulatedClock clock;
    clock.reset(100);
    clock.tick(1000, 0);
    clock.tick(1100, 0);  // no jump yet
    EXPECT_EQ(due(clock, 50), (Times{1000, 1050, 1100}));
    clock.tick(1201, 0);
    EXPECT_EQ(due(clock, 50), Times{1201});
    const std::int64_t back = 1201 - SimulatedClock::kLongestStep - 1;
    clock.tick(back, 0);
    clock.tick(back + 55, 0);
    EXPECT_EQ(due(clock, 50), (Times{back, back + 50}));
    std::vector<std::int64_t> to;
    while (const auto jump = clock.takeJump()) to.push_back(jump->to_ns);
    EXPECT_EQ(to, (Times{1000, 1201, back}));
    EXPECT_EQ(clock.now(), back + 55);
    EXPECT_EQ(clock.takeSteps().count, 0);
}

TEST(SimulatedClock, WaitsOutShortStepsBack) {
    constexpr std::int64_t kSpan = 1000 * kMillisecond;
    SimulatedClock clock;
    clock.reset(kNoJump);
    std::size_t cycles = 0;
    // Each fifth tick is 8 ms late, as of a bag with a jittering clock.
    for (std::int64_t tick = 0; tick <= 100; ++tick) {
        const std::int64_t late = tick % 5 == 4 ? 18 * kMillisecond : 0;
        clock.tick(tick * 10 * kMillisecond - late, 0);
        cycles += due(clock, kMillisecond).size();
    }
    EXPECT_EQ(cycles, kSpan / kMillisecond + 1);
    EXPECT_TRUE(clock.takeJump());
    EXPECT_FALSE(clock.takeJump());
    const executor::ClockSteps steps = clock.takeSteps();
    EXPECT_EQ(steps.count, 20);
    EXPECT_EQ(steps.longest_ns, 8 * kMillisecond);
    EXPECT_EQ(clock.takeSteps().count, 0);
}

TEST(SimulatedClock, FollowsAClockThatGoesBackInManyShortSteps) {
    SimulatedClock clock;
    clock.reset(kNoJump);
    for (std::int64_t tick = 100; tick >= 0; --tick) clock.tick(tick * 10 * kMillisecond, 0);
    Times times = due(clock, kMillisecond);
    ASSERT_EQ(times.size(), 10);
    EXPECT_EQ(times.back(), 10 * kMillisecond);
}

TEST(SimulatedClock, KnowsWhenItMovedLast) {
    SimulatedClock clock;
    clock.reset(kNoJump);
    EXPECT_FALSE(clock.lastMove());
    clock.tick(5000, 100);
    clock.tick(5000, 200);
    EXPECT_EQ(clock.lastMove(), 100);
    clock.tick(5010, 300);
    EXPECT_EQ(clock.lastMove(), 300);
}

TEST(SimulatedClock, ForgetsItsTicksAtARestart) {
    SimulatedClock clock;
    clock.reset(kNoJump);
    clock.tick(1000, 0);
    clock.reset(kNoJump);
    EXPECT_EQ(due(clock, 10), Times{});
    EXPECT_FALSE(clock.takeJump());
    EXPECT_FALSE(clock.now());
}

TEST(SimulatedClock, SpreadsArrivalsBetweenTwoTicksOverTheirCycles) {
    SimulatedClock clock;
    clock.reset(1000);
    const auto arrivals = [&] {
        Times times;
        while (const auto cycle = clock.next(10, std::chrono::milliseconds(0)))
            times.push_back(cycle->arrived_ns);
        return times;
    };
    clock.tick(100, 7000);
    EXPECT_EQ(arrivals(), Times{7000});
    clock.tick(140, 7800);
    EXPECT_EQ(arrivals(), (Times{7200, 7400, 7600, 7800}));
    clock.tick(145, 8000);
    clock.tick(145, 9000);  // it has stopped: arrivals do not get later times
    clock.tick(155, 9100);
    EXPECT_EQ(arrivals(), Times{9050});
    clock.tick(-SimulatedClock::kLongestStep, 9500);  // a jump: earlier arrivals are older
    EXPECT_EQ(arrivals(), Times{9500});
}

TEST(SimulatedClock, KnowsItsRateBetweenCycles) {
    SimulatedClock clock;
    clock.reset(1000);
    using Rates = std::vector<double>;
    const auto rates = [&] {
        Rates all;
        while (const auto cycle = clock.next(10, std::chrono::milliseconds(0)))
            all.push_back(cycle->rate);
        return all;
    };
    clock.tick(100, 7000);
    EXPECT_EQ(rates(), Rates{0.0}) << "the first tick";
    clock.tick(120, 7040);
    EXPECT_EQ(rates(), (Rates{0.5, 0.5}));
    clock.tick(125, 7050);
    clock.tick(125, 9000);  // it has stopped
    clock.tick(135, 9010);
    EXPECT_EQ(rates(), Rates{10.0 / (9005 - 7040)}) << "the average rate";
    clock.tick(140, 9010);  // two ticks at once
    EXPECT_EQ(rates(), Rates{10.0 / (9010 - 9005)});
    clock.tick(150, 9010);
    EXPECT_EQ(rates(), Rates{0.0}) << "no time has passed";
    const std::int64_t back = -SimulatedClock::kLongestStep;
    clock.tick(back, 9500);
    EXPECT_EQ(rates(), Rates{0.0}) << "the clock jumped";
    clock.tick(back + 10, 9520);
    EXPECT_EQ(rates(), Rates{0.5});
}

class QueueingInjector : public ::testing::Test {
   protected:
    void deliver(double value, std::int64_t arrived_ns) {
        std::vector<std::uint8_t> bytes(sizeof value);
        std::memcpy(bytes.data(), &value, sizeof value);
        injector_.deliver(bytes.data(), sizeof value, arrived_ns);
    }
    // The value that a cycle reads; nothing if it is not new.
    std::optional<double> cycle(std::int64_t arrived_ns, double rate = 0.0) {
        injector_.deliverUntil(arrived_ns, rate);
        if (!injector_.adopt(clock_)) return {};
        return static_cast<const Slot<double>*>(injector_.front())->value;
    }

    Injector injector_{"/x", typeInfo<double>()};
    LoopClock clock_{};
};

TEST_F(QueueingInjector, ReturnsTheNewestValueOfEachCyclesTime) {
    injector_.setQueueing(true);
    deliver(1.0, 10);
    deliver(2.0, 15);
    deliver(3.0, 25);
    deliver(4.0, 31);
    EXPECT_EQ(cycle(5), std::nullopt);
    EXPECT_EQ(cycle(20), 2.0);
    EXPECT_EQ(cycle(30), 3.0);
    EXPECT_EQ(cycle(30), std::nullopt);
    EXPECT_EQ(cycle(40), 4.0);
    EXPECT_EQ(injector_.passedOver(), 1);
}

TEST_F(QueueingInjector, DoesNotDelayATopicFasterThanTheLoop) {
    injector_.setQueueing(true);
    for (int round = 1; round <= 1000; ++round) {
        for (int part = 0; part < 4; ++part) deliver(round + part / 4.0, round * 100 + part);
        EXPECT_EQ(cycle(round * 100 + 50), round + 0.75);
    }
    EXPECT_EQ(injector_.passedOver(), 3000);
}

TEST_F(QueueingInjector, AgeIsThatOfTheMessageInSimulatedTime) {
    const auto time = [&] { return injector_.front()->stamp; };
    injector_.setQueueing(true);
    deliver(1.0, 50);
    deliver(2.0, 80);
    clock_.time_ns = 1000;
    EXPECT_EQ(cycle(100, 2.0), 2.0);
    EXPECT_EQ(time(), 1000 - 40);
    deliver(3.0, 104);
    deliver(4.0, 120);
    clock_.time_ns = 1010;
    EXPECT_EQ(cycle(110, 0.5), 3.0);
    EXPECT_EQ(time(), 1010 - 3);
    clock_.time_ns = 1020;
    EXPECT_EQ(cycle(120, 0.5), 4.0);
    EXPECT_EQ(time(), 1020) << "the message arrived with the cycle";
    injector_.setQueueing(false);
    deliver(5.0, 130);
    clock_.time_ns = 1030;
    EXPECT_EQ(cycle(200), 5.0);
    EXPECT_EQ(time(), 1030) << "in real time its age counts from the cycle that reads it";
}

TEST_F(QueueingInjector, ReturnsTheNewestValueAfterTheQueueIsOff) {
    injector_.setQueueing(true);
    deliver(1.0, 10);
    deliver(2.0, 20);
    deliver(3.0, 30);
    EXPECT_EQ(cycle(10), 1.0);
    injector_.setQueueing(false);
    EXPECT_EQ(cycle(10), 3.0);
    deliver(4.0, 40);
    deliver(5.0, 50);
    EXPECT_EQ(cycle(10), 5.0);
    EXPECT_EQ(injector_.passedOver(), 2);
}

TEST_F(QueueingInjector, KeepsTheNewestValuesWhileTheClockIsStopped) {
    injector_.setQueueing(true);
    for (int value = 1; value <= 200'000; ++value) deliver(value, value);
    EXPECT_EQ(injector_.passedOver(), 190'000);
    EXPECT_EQ(cycle(190'001), 190'001.0);  // the oldest remaining one
    EXPECT_EQ(cycle(300'000), 200'000.0);
}

}  // namespace
}  // namespace rtcf::test
