// Cycles on a simulated clock: the same graph always gives the same values.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <thread>
#include <vector>

#include "support/runner_fixture.hpp"
#include "view/runner_view.hpp"

namespace rtcf::test {
namespace {

class Stepping : public RunnerFixture {
   protected:
    void mapPapersTopics() {
        configure(
            [](RunnerSettings& settings) { settings.whitelist = ".*R3_G2H1|.*R1_H1R2|.*G2_R2"; });
    }

    void deliver(const std::string& topic, double number) {
        std::array<std::uint8_t, sizeof number> bytes{};
        std::memcpy(bytes.data(), &number, sizeof number);
        ASSERT_TRUE(bridge().injector(topic)->deliver(bytes.data(), sizeof number));
    }

    executor::ReplayOutcome replay(const executor::ReplayChunk& chunk) {
        return onGraphThread([&] { return runner().replay(chunk, [](const std::string&) {}); });
    }

    std::vector<double> taken(const std::string& topic) {
        std::vector<double> values;
        while (bridge().tap(topic)->pop(
            [&](const std::uint8_t* bytes, std::uint32_t size, std::int64_t) {
                double number = 0.0;
                ASSERT_EQ(size, sizeof number);
                std::memcpy(&number, bytes, sizeof number);
                values.push_back(number);
            })) {
        }
        return values;
    }
};

// The five sums of Fig. 1, computed separately.
class Fig1Model {
   public:
    // @param g2 value of R2.in4 in this cycle. @return R3's output
    double cycle(double g2) {
        const double h1 = limited(first_ ? 1.0 : r3_ + r1_);
        const double f1 = limited(h1);
        r1_ = limited(h1);
        const double r2 = limited(f1 + h1 + r1_ + g2);
        r3_ = limited(f1 + r2);
        first_ = false;
        return r3_;
    }

   private:
    static double limited(double sum) { return sum > 1e20 ? 1.0 : sum; }
    bool first_ = true;
    double r1_ = 0.0;
    double r3_ = 0.0;
};

TEST_F(Stepping, MessageKIsIterationKOfAnIndependentModel) {
    loadFig1();
    mapPapersTopics();
    deliver("/G2_R2", 0.5);
    Fig1Model model;
    for (int round = 0; round < 10; ++round) {
        step(100);
        std::vector<double> expected;
        for (int i = 0; i < 100; ++i)
            expected.push_back(model.cycle(round == 0 && i == 0 ? 0.5 : 0.0));
        ASSERT_EQ(taken("/R3_G2H1"), expected) << "round " << round;
    }
    EXPECT_EQ(bridge().tap("/R3_G2H1")->dropped(), 0U);
}

TEST_F(Stepping, InjectedValueIsReadInTheNextCycleOnly) {
    loadFig1();
    mapPapersTopics();
    step(2);
    Fig1Model model;
    model.cycle(0.0);
    model.cycle(0.0);
    deliver("/G2_R2", 1.0);
    deliver("/G2_R2", 0.25);  // the newest applies
    taken("/R3_G2H1");
    step(2);
    const std::vector<double> expected{model.cycle(0.25), model.cycle(0.0)};
    EXPECT_EQ(taken("/R3_G2H1"), expected);
}

TEST_F(Stepping, LatchedValueFromOutsideIsSeenBeforeTheStart) {
    loadFig1();
    mapPapersTopics();
    deliver("/G2_R2", 7.5);
    EXPECT_EQ(value("/R2", "in4"), 7.5);
}

TEST_F(Stepping, RunsExactlyAsManyCyclesAsAsked) {
    load(definition("Ticker", "T"));
    EXPECT_EQ(state(), RunnerState::Stopped);
    step(1);
    EXPECT_EQ(iteration(), 1U);
    step(41);
    EXPECT_EQ(iteration(), 42U);
    EXPECT_EQ(state(), RunnerState::Stepping);
    EXPECT_EQ(value("/T", "out"), 41.0);
}

TEST_F(Stepping, StartsOverAfterStop) {
    load(definition("Ticker", "T"));
    step(10);
    stop();
    EXPECT_EQ(state(), RunnerState::Stopped);
    step(3);
    EXPECT_EQ(iteration(), 3U);
    EXPECT_EQ(value("/T", "out"), 2.0);
}

TEST_F(Stepping, CallsTheHooksOnceAndSafeAtItsEnd) {
    load(definition("Recorder", "A"));
    step(5);
    step(5);
    stop();
    EXPECT_EQ(journal().notes(), (std::vector<std::string>{"/A configure", "/A start", "/A update",
                                                           "/A safe", "/A stop"}));
}

TEST_F(Stepping, IsRejectedWhileTheLoopRuns) {
    load(definition("Ticker", "T"));
    start();
    const std::string text = errorOf([this] { step(1); });
    EXPECT_NE(text.find("rtcfctl -r rt_runner stop"), std::string::npos) << text;
    EXPECT_TRUE(runs());
}

TEST_F(Stepping, CanBeFollowedByRunning) {
    load(definition("Recorder", "A"));
    step(5);
    start();
    EXPECT_EQ(state(), RunnerState::Running);
    EXPECT_TRUE(runs());
    EXPECT_EQ(journal().count("/A safe"), 1U) << "at the end of stepping";
    EXPECT_EQ(journal().count("/A start"), 2U);
}

TEST_F(Stepping, EndsOnRequest) {
    load(definition("Ticker", "T"));
    auto endless =
        begin([this] { return runner().step(std::uint64_t{1} << 60, [](const std::string&) {}); });
    ASSERT_TRUE(eventually([this] { return iteration() > 100; }));
    runner().requestStop();
    endless.get();
    EXPECT_EQ(state(), RunnerState::Stopped);
}

TEST_F(Stepping, PausesWhenItsCallerLeaves) {
    load(definition("Ticker", "T"));
    std::atomic<bool> given_up{false};
    auto endless = begin([&] {
        return runner().step(std::uint64_t{1} << 60, [](const std::string&) {}, &given_up);
    });
    ASSERT_TRUE(eventually([this] { return iteration() > 100; }));
    given_up = true;
    const std::uint64_t cycles = endless.get().cycles;
    EXPECT_EQ(cycles, iteration());
    EXPECT_EQ(state(), RunnerState::Stepping);
    const std::uint64_t before = iteration();
    step(5);
    EXPECT_EQ(iteration(), before + 5) << "the next step continues there";
}

TEST_F(Stepping, EndsWithItsRunner) {
    load(definition("Ticker", "T"));
    Runner& ending = runner();
    const auto endless = [&ending] {
        return ending.step(std::uint64_t{1} << 60, [](const std::string&) {});
    };
    auto begun = begin(endless);
    auto queued = begin(endless);
    ASSERT_TRUE(eventually([this] { return iteration() > 100; }));
    endRunner();
    SUCCEED() << "and queued steps do not start";
}

TEST_F(Stepping, StopsInTheCycleThatFails) {
    ComponentDefinition failing = definition("Recorder", "B");
    failing.parameters = {{"throws_at", std::int64_t{3}}};
    failing.remaps = {{"out", "B_out"}};
    load(failing);
    load(definition("Ticker", "T"));
    step(100);
    EXPECT_EQ(iteration(), 4U);
    EXPECT_EQ(state(), RunnerState::Faulted);
    EXPECT_EQ(value("/T", "out"), 2.0) << "the cycle ended where it failed";
}

// The ROS node reads values out at any time: it must never have held a replay's taps.
TEST_F(Stepping, ReplayHasExclusiveUseOfThePorts) {
    loadFig1();
    mapPapersTopics();
    const std::size_t given = bridge().everGiven("/R3_G2H1");
    ASSERT_GT(given, 0U);
    executor::ReplayChunk chunk;
    chunk.begin = true;
    chunk.start_ns = 1'000'000'000;
    replay(chunk);
    EXPECT_EQ(bridge().tap("/R3_G2H1"), nullptr);
    EXPECT_EQ(bridge().injector("/G2_R2"), nullptr);
    chunk.begin = false;
    chunk.until_ns = 1'100'000'000;
    const auto outcome = replay(chunk);
    EXPECT_GT(outcome.cycles, 1U);
    EXPECT_EQ(bridge().everGiven("/R3_G2H1"), given);
    EXPECT_EQ(std::count_if(outcome.outputs.begin(), outcome.outputs.end(),
                            [](const auto& output) { return output.topic == "/R3_G2H1"; }),
              static_cast<std::ptrdiff_t>(outcome.cycles));
    chunk.end = true;
    replay(chunk);
    EXPECT_EQ(taken("/R3_G2H1"), std::vector<double>{}) << "ROS receives nothing of the replay";
    EXPECT_NE(bridge().injector("/G2_R2"), nullptr);
}

// Steps and replays run faster than statistics are counted elsewhere.
TEST_F(Stepping, EachStepAndEachReplayedCycleIsInTheStatistics) {
    constexpr std::uint64_t kSteps = 100'000;
    configure([](RunnerSettings& settings) { settings.loop.warmup_cycles = 0; });
    load(definition("Ticker", "A"));
    step(kSteps);
    EXPECT_EQ(durations().duration().snapshot().count, kSteps);
    EXPECT_EQ(durations().lost(), 0U);
    EXPECT_EQ(runner().graph()->get("/A").statistics->duration.snapshot().count, kSteps);

    executor::ReplayChunk chunk;
    chunk.begin = true;
    chunk.start_ns = 1'000'000'000;
    replay(chunk);
    chunk.begin = false;
    chunk.until_ns = 31'000'000'000;
    const auto outcome = replay(chunk);
    EXPECT_GT(outcome.cycles, 20'000U);
    EXPECT_EQ(durations().duration().snapshot().count, kSteps + outcome.cycles);
    EXPECT_EQ(durations().lost(), 0U);
}

// As the ROS node does for subscribers of `cycles`.
TEST_F(Stepping, StepsWaitForAReaderOfAllCycles) {
    constexpr std::uint64_t kSteps = 20'000;
    load(definition("Ticker", "A"));
    executor::RunnerView& view = *bridge().runner;
    executor::CycleRecord cycle{};
    while (view.nextCycle(cycle)) {
    }
    std::atomic<bool> done{false};
    std::vector<std::uint64_t> found;
    std::thread reader([&] {
        for (bool last = false; !last;) {
            last = done;
            while (view.nextCycle(cycle)) found.push_back(cycle.iteration);
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
        }
    });
    step(kSteps);
    done = true;
    reader.join();
    EXPECT_EQ(found.size(), kSteps);
    EXPECT_TRUE(std::is_sorted(found.begin(), found.end()));
    EXPECT_EQ(view.cyclesLost(), 0U);
}

TEST_F(Stepping, StepsWaitForTheNode) {
    constexpr std::uint64_t kSteps = 20'000;
    configure([](RunnerSettings& settings) { settings.whitelist = "/A_out"; });
    ComponentDefinition ticker = definition("Ticker", "A");
    ticker.remaps = {{"out", "A_out"}};
    load(ticker);
    const auto tap = bridge().tap("/A_out");
    ASSERT_NE(tap, nullptr);
    const auto ignore = [](const std::uint8_t*, std::uint32_t, std::int64_t) {};
    EXPECT_FALSE(tap->pop(ignore)) << "nothing was written yet";
    std::atomic<bool> done{false};
    std::uint64_t found = 0;
    std::thread reader([&] {
        for (bool last = false; !last;) {
            last = done;
            while (tap->pop(ignore)) ++found;
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
    });
    step(kSteps);
    done = true;
    reader.join();
    EXPECT_EQ(found, kSteps);
    EXPECT_EQ(tap->dropped(), 0U);
}

}  // namespace
}  // namespace rtcf::test
