// A component that waits for its device and thereby paces the loop.
#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "support/runner_fixture.hpp"

namespace rtcf::test {
namespace {

class SourceTest : public RunnerFixture {
   protected:
    static ComponentDefinition device(const std::string& name) {
        ComponentDefinition result = definition("Device", name);
        result.remaps = {{"out", name + "_out"}};
        return result;
    }

    // One event of the device. @return false if it causes no cycle
    bool tick() {
        const std::uint64_t before = iteration();
        journal().gate_open.store(true);
        return eventually([&] { return iteration() > before; });
    }

    void startSilent(const std::string& name = "D") {
        load(device(name));
        journal().gate_open.store(false);
        start();
    }
};

TEST_F(SourceTest, PacesTheLoop) {
    startSilent();
    for (int i = 1; i <= 50; ++i) {
        ASSERT_TRUE(tick());
        ASSERT_EQ(value("/D", "out"), static_cast<double>(i));
    }
    EXPECT_EQ(iteration(), 50U) << "one cycle per event of the device";
    EXPECT_LT(runner().loop().statistics().overruns.value(), 10U)
        << "waiting for the device is no overrun; the machine may delay a cycle";
}

TEST_F(SourceTest, MissedEventsAreCountedAndReported) {
    ComponentDefinition watch = definition("Watch", "W");
    watch.remaps = {{"in", "D_out"}};
    load(watch);
    startSilent();
    ASSERT_TRUE(tick());
    EXPECT_EQ(value("/W", "since"), 1.0);
    EXPECT_EQ(runner().loop().statistics().missed.value(), 0U);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    ASSERT_TRUE(tick());
    const double periods = value("/W", "since");
    EXPECT_GE(periods, 19.0) << "elapsed() is whole periods since the last update";
    EXPECT_EQ(runner().loop().statistics().missed.value(), static_cast<std::uint64_t>(periods) - 1);
}

TEST_F(SourceTest, LatencyIsTheDeviationOfAnEvent) {
    startSilent();
    for (int i = 0; i < 60; ++i) ASSERT_TRUE(tick());
    const auto latency = durations().latency().snapshot();
    EXPECT_EQ(latency.count, 50U);
    EXPECT_GT(latency.maximum, 0);
    EXPECT_LE(latency.maximum, 500'000) << "half a period: more would be another event";
}

TEST_F(SourceTest, ChangesAreAdoptedWhileItIsSilent) {
    startSilent();
    ASSERT_TRUE(tick());
    load(definition("Recorder", "A"));
    setParameters("/A", {{"gain", 2.0}});
    EXPECT_EQ(order(), (std::vector<std::string>{"/A", "/D"}));
    EXPECT_EQ(iteration(), 1U);
    EXPECT_EQ(value("/D", "out"), 1.0) << "queries are answered, too";
    ASSERT_TRUE(tick());
    EXPECT_EQ(value("/A", "out"), 2.0);
}

TEST_F(SourceTest, LoopStopsWhileItIsSilent) {
    startSilent();
    load(definition("Recorder", "A"));
    stop();
    EXPECT_EQ(state(), RunnerState::Stopped);
    EXPECT_EQ(iteration(), 0U);
    EXPECT_EQ(journal().count("/A safe"), 1U);
}

TEST_F(SourceTest, ClockPacesTheLoopWithoutIt) {
    startSilent();
    load(definition("Recorder", "A"));
    unload("/D");
    EXPECT_TRUE(runs(50));
    load(device("E"));
    const std::uint64_t before = iteration();
    ASSERT_TRUE(tick());
    EXPECT_LE(iteration(), before + 2) << "the next source paces the loop again";
}

TEST_F(SourceTest, TwoAreRejectedByName) {
    startSilent();
    const std::string text = errorOf([&] { load(device("E")); });
    EXPECT_NE(text.find("/D and /E both pace the loop"), std::string::npos) << text;
    EXPECT_EQ(order(), std::vector<std::string>{"/D"});
    replace("/D", device("E"));
    ASSERT_TRUE(tick());
}

}  // namespace
}  // namespace rtcf::test
