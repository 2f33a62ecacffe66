// A loop with cycles that take too long. The tests assert no times, only the counters
// after a cycle that took 6 ms instead of 1 ms.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>

#include "support/runner_fixture.hpp"

namespace rtcf::test {
namespace {

using executor::OverrunPolicy;

class LoopTiming : public RunnerFixture {
   protected:
    // Runs a loop in which `cycles` cycles take 6 ms, and stops it later, in cycle `until`.
    void overrun(OverrunPolicy policy, std::int64_t cycles = 1, std::int64_t busy_us = 6000,
                 std::uint64_t until = 60) {
        configure([policy](RunnerSettings& settings) { settings.loop.overrun = policy; });
        ComponentDefinition spinner = definition("Spinner", "S");
        spinner.parameters = {{"busy_us", busy_us}, {"busy_cycles", cycles}};
        load(spinner);
        start();
        EXPECT_TRUE(eventually([&] { return iteration() > until; }));
        stop();
    }

    std::uint64_t overruns() { return runner().loop().statistics().overruns.value(); }
    std::uint64_t missed() { return runner().loop().statistics().missed.value(); }
    std::vector<std::string> linesOnOverruns() const {
        std::vector<std::string> lines;
        for (const RunnerEvent& event : events()) {
            if (event.kind == RunnerEvent::Kind::Overruns) lines.push_back(event.message);
        }
        return lines;
    }
    // The sum of elapsed(), in periods.
    double periods() { return value("/S", "periods"); }
};

TEST_F(LoopTiming, SkipDropsMissedCyclesAndCountsThemInElapsed) {
    overrun(OverrunPolicy::Skip);
    EXPECT_GE(overruns(), 1U);
    EXPECT_GE(missed(), 5U);
    EXPECT_GE(periods(), static_cast<double>(iteration() + 5));
    EXPECT_LE(periods(), static_cast<double>(iteration() + missed()));
}

TEST_F(LoopTiming, CatchUpDropsNothing) {
    // A hundred periods are longer than any stall of a shared machine.
    configure([](RunnerSettings& settings) { settings.frequency_hz = 20.0; });
    overrun(OverrunPolicy::CatchUp, 1, 120'000, 25);
    EXPECT_GE(overruns(), 1U);
    EXPECT_EQ(missed(), 0U);
    EXPECT_EQ(periods(), static_cast<double>(iteration()));
}

// As after a freeze: 500 cycles are missed together.
TEST_F(LoopTiming, CatchUpRunsNoMoreThanAHundredCyclesInARow) {
    configure([](RunnerSettings& settings) { settings.loop.warmup_cycles = 0; });
    overrun(OverrunPolicy::CatchUp, 1, 500'000, 200);
    EXPECT_GE(overruns(), 1U);
    EXPECT_GE(missed(), 400U) << "the rest";
    EXPECT_GE(periods(), static_cast<double>(iteration() + 400));
    EXPECT_LE(periods(), static_cast<double>(iteration() + missed()));
}

TEST_F(LoopTiming, RelativeRestartsThePeriod) {
    overrun(OverrunPolicy::Relative);
    EXPECT_GE(overruns(), 1U);
    EXPECT_EQ(missed(), 0U);
    EXPECT_GE(periods(), static_cast<double>(iteration() + 6))
        << "whole periods since the last update";
}

TEST_F(LoopTiming, OverrunIsCountedForTheComponentThatWasRunning) {
    load(definition("Ticker", "A"));
    overrun(OverrunPolicy::Skip);
    EXPECT_GE(runner().graph()->get("/S").statistics->overruns.value(), 1U);
}

TEST_F(LoopTiming, AChangesDurationIsNoComponentsOverrun) {
    load(definition("Ticker", "A"));
    ComponentDefinition relay = definition("Relay", "B");
    relay.remaps = {{"out", "B_out"}};
    load(relay);
    start();
    ASSERT_TRUE(runs());
    replace("/B", definition("SlowSuccessor", "B"));
    ASSERT_TRUE(runs());
    EXPECT_GE(runner().loop().statistics().exchange_overruns.value(), 1U);
}

// The process is stopped between two cycles, as by a hypervisor.
TEST_F(LoopTiming, LateWakeUpIsASeparateCause) {
    load(definition("Ticker", "A"));
    start();
    ASSERT_TRUE(runs());
    const auto late = [this] { return runner().loop().statistics().late_wake_ups.value(); };
    EXPECT_TRUE(eventually([&] {
        const pid_t self = getpid();
        const pid_t helper = fork();
        if (helper == 0) {
            kill(self, SIGSTOP);
            usleep(10'000);
            kill(self, SIGCONT);
            _exit(0);
        }
        waitpid(helper, nullptr, 0);
        return runs(2) && late() > 0;
    }));
    stop();  // statistics that no longer change
    EXPECT_LE(late() + runner().graph()->get("/A").statistics->overruns.value(), overruns());
}

TEST_F(LoopTiming, AnOverloadedLoopRestsUntilAChangeMakesItFaster) {
    load(definition("Ticker", "A"));
    ComponentDefinition spinner = definition("Spinner", "S");
    spinner.parameters = {{"busy_us", std::int64_t{3900}},
                          {"busy_cycles", std::int64_t{1'000'000}}};
    load(spinner);
    start();
    ASSERT_TRUE(eventually([this] { return runner().loop().rests() > 10; }));
    ASSERT_TRUE(eventually([this] {
        const std::vector<std::string> lines = linesOnOverruns();
        return !lines.empty() && lines.back().find("the loop is overloaded") != std::string::npos;
    }));
    unload("/S");
    EXPECT_TRUE(eventually([this] {
        const std::uint64_t before = runner().loop().rests();
        return runs(20) && runner().loop().rests() == before;
    }));
}

// Without full real-time rights a loop is not blamed for being late.
TEST_F(LoopTiming, FullBucketStopsTheLoopUnlessItRunsDegraded) {
    configure([](RunnerSettings& settings) { settings.loop.max_overruns = 3; });
    ComponentDefinition spinner = definition("Spinner", "S");
    spinner.parameters = {{"busy_us", std::int64_t{3000}}, {"busy_cycles", std::int64_t{10}}};
    load(spinner);
    load(definition("Recorder", "A"));
    start();
    if (runner().status().degraded.empty()) {
        ASSERT_TRUE(eventually([this] { return state() == RunnerState::Faulted; }));
        EXPECT_EQ(events().back().kind, RunnerEvent::Kind::LoopEnded);
        EXPECT_NE(events().back().message.find("more than 3 overruns"), std::string::npos);
        EXPECT_EQ(overruns(), 4U);
        EXPECT_EQ(journal().count("/A safe"), 1U);
        EXPECT_TRUE(eventually([this] { return !linesOnOverruns().empty(); }));
    } else {
        EXPECT_TRUE(runs(60));
        EXPECT_EQ(state(), RunnerState::Running);
        ASSERT_TRUE(eventually([this] { return !linesOnOverruns().empty(); }));
        EXPECT_NE(linesOnOverruns()[0].find("max_overruns does not stop a degraded loop"),
                  std::string::npos)
            << linesOnOverruns()[0];
    }
}

TEST_F(LoopTiming, ManyOverrunsAreOneLine) {
    overrun(OverrunPolicy::Skip, 30);
    ASSERT_GE(overruns(), 30U);
    const std::vector<std::string> lines = linesOnOverruns();
    ASSERT_LE(lines.size(), 2U) << "the first overrun, and the rest at the end of the loop";
    EXPECT_NE(lines.back().find("ended late"), std::string::npos) << lines.back();
    // One of the two lines may report only cycles delayed by the machine.
    EXPECT_TRUE(std::any_of(lines.begin(), lines.end(), [](const std::string& line) {
        return line.find("in /S") != std::string::npos;
    })) << lines.front();
}

TEST_F(LoopTiming, SpinFollowsTheWakeUpLatencyUpToATenthOfThePeriod) {
    configure([](RunnerSettings& settings) { settings.spin_auto = true; });
    load(definition("Ticker", "A"));
    start();
    ASSERT_TRUE(eventually([this] { return runner().status().settings.loop.spin_ns > 0; }));
    EXPECT_LE(runner().status().settings.loop.spin_ns, 100'000);
    // The chosen value is not a setting that could conflict with others.
    configure([](RunnerSettings& settings) { settings.frequency_hz = 4000.0; });
    ASSERT_TRUE(runs());
    EXPECT_LE(runner().status().settings.loop.spin_ns, 25'000);
    configure([](RunnerSettings& settings) { settings.spin_auto = false; });
    EXPECT_EQ(runner().status().settings.loop.spin_ns, 0);
}

TEST_F(LoopTiming, EveryCycleIsInTheStatistics) {
    configure([](RunnerSettings& settings) { settings.loop.warmup_cycles = 0; });
    load(definition("Ticker", "A"));
    start();
    ASSERT_TRUE(runs(100));
    stop();
    EXPECT_EQ(durations().duration().snapshot().count, iteration());
    EXPECT_EQ(durations().latency().snapshot().count, iteration());
    EXPECT_EQ(runner().graph()->get("/A").statistics->duration.snapshot().count, iteration());
}

TEST_F(LoopTiming, WarmUpIsNotInTheStatistics) {
    configure([](RunnerSettings& settings) { settings.loop.warmup_cycles = 10; });
    load(definition("Ticker", "A"));
    start();
    ASSERT_TRUE(runs(100));
    stop();
    EXPECT_EQ(durations().duration().snapshot().count, iteration() - 10);
    EXPECT_EQ(runner().graph()->get("/A").statistics->duration.snapshot().count, iteration() - 10);
}

}  // namespace
}  // namespace rtcf::test
