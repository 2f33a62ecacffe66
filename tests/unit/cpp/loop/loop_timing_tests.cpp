// What a loop does when a cycle takes too long. No times are asserted here, only
// what the counters must say of a cycle that took 6 ms of 1 ms.
#include <gtest/gtest.h>

#include "support/runner_fixture.hpp"

namespace rtcf::test {
namespace {

using executor::OverrunPolicy;

class LoopTiming : public RunnerFixture {
   protected:
    // Runs a loop in which `cycles` cycles take 6 ms, and stops it some time after.
    void overrun(OverrunPolicy policy, std::int64_t cycles = 1) {
        configure([policy](RunnerSettings& settings) { settings.loop.overrun = policy; });
        ComponentDefinition spinner = definition("Spinner", "S");
        spinner.parameters = {{"busy_us", std::int64_t{6000}}, {"busy_cycles", cycles}};
        load(spinner);
        start();
        EXPECT_TRUE(eventually([this] { return iteration() > 60; }));
        stop();
    }

    std::uint64_t overruns() { return runner().loop().figures().overruns.load(); }
    std::uint64_t missed() { return runner().loop().figures().missed.load(); }
    // What elapsed() added up to, in periods.
    double periods() { return value("/S", "periods"); }
};

TEST_F(LoopTiming, SkipDropsTheMissedCyclesAndTellsTheNextOne) {
    overrun(OverrunPolicy::Skip);
    EXPECT_GE(overruns(), 1U);
    EXPECT_GE(missed(), 5U);
    EXPECT_GE(periods(), static_cast<double>(iteration() + 5));
    EXPECT_LE(periods(), static_cast<double>(iteration() + missed()));
}

TEST_F(LoopTiming, CatchUpDropsNothing) {
    overrun(OverrunPolicy::CatchUp);
    EXPECT_GE(overruns(), 1U);
    EXPECT_EQ(missed(), 0U);
    EXPECT_EQ(periods(), static_cast<double>(iteration()));
}

TEST_F(LoopTiming, RelativeBeginsThePeriodAnew) {
    overrun(OverrunPolicy::Relative);
    EXPECT_GE(overruns(), 1U);
    EXPECT_EQ(missed(), 0U);
    EXPECT_GE(periods(), static_cast<double>(iteration() + 6))
        << "whole periods since the last update";
}

TEST_F(LoopTiming, OverrunIsCountedForTheComponentThatWasRunning) {
    load(definition("Ticker", "A"));
    overrun(OverrunPolicy::Skip);
    EXPECT_GE(runner().snapshot()->get("/S").figures->overruns.load(), 1U);
}

TEST_F(LoopTiming, EveryCycleIsInTheFigures) {
    configure([](RunnerSettings& settings) { settings.loop.warmup_cycles = 0; });
    load(definition("Ticker", "A"));
    start();
    ASSERT_TRUE(runs(100));
    stop();
    const executor::LoopFigures& figures = runner().loop().figures();
    EXPECT_EQ(figures.duration.snapshot().count, iteration());
    EXPECT_EQ(figures.latency.snapshot().count, iteration());
    EXPECT_EQ(runner().snapshot()->get("/A").figures->duration.snapshot().count, iteration());
}

TEST_F(LoopTiming, WarmUpIsNotInTheFigures) {
    configure([](RunnerSettings& settings) { settings.loop.warmup_cycles = 10; });
    load(definition("Ticker", "A"));
    start();
    ASSERT_TRUE(runs(100));
    stop();
    EXPECT_EQ(runner().loop().figures().duration.snapshot().count, iteration() - 10);
    EXPECT_EQ(runner().snapshot()->get("/A").figures->duration.snapshot().count, iteration() - 10);
}

}  // namespace
}  // namespace rtcf::test
