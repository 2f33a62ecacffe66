// Only in a build with RealtimeSanitizer, which ends the program at the first call in
// the cycle that may block: allocation, lock, system call.
#include <gtest/gtest.h>

#include <cstring>

#include "support/runner_fixture.hpp"

namespace rtcf::test {
namespace {

class RealtimeSafety : public RunnerFixture {
   protected:
    void drainTaps() {
        for (const char* topic : {"/R3_G2H1", "/R1_H1R2", "/T_out"}) {
            const auto tap = bridge().tap(topic);
            while (tap && tap->pop([](const std::uint8_t*, std::uint32_t, std::int64_t) {})) {
            }
        }
    }

    void deliver(double number) {
        const auto injector = bridge().injector("/G2_R2");
        ASSERT_NE(injector, nullptr);
        injector->deliver(reinterpret_cast<const std::uint8_t*>(&number), sizeof number);
    }
};

TEST_F(RealtimeSafety, Fig1WithTopicsLogsAndHotSwapsIsSafe) {
    loadFig1();
    configure([](RunnerSettings& settings) {
        settings.whitelist = ".*R3_G2H1|.*R1_H1R2|.*G2_R2|/T_out";
    });
    start();
    ASSERT_TRUE(runs());
    ComponentDefinition talker = definition("Talker", "T");
    talker.remaps = {{"out", "T_out"}};
    ComponentDefinition recorder = definition("Recorder", "Z");
    recorder.remaps = {{"in", "R3_G2H1"}, {"out", "Z_out"}};
    recorder.breaks.ports = {"in"};
    load(definition("Chatter", "C"));
    for (int round = 0; round < 30; ++round) {
        load(talker);
        load(recorder);
        deliver(static_cast<double>(round));
        ASSERT_TRUE(runs(30));
        setParameters("/Z", {{"gain", 2.0}});
        replace("/Z", recorder);
        setBreak("/R2", "in4", round % 2 == 0);
        onGraphThread([this] { return runner().probe("/T"); });
        ASSERT_TRUE(runs(30));
        drainTaps();
        unload("/T");
        unload("/Z");
    }
    stop();
    EXPECT_GT(iteration(), 1800U);
    EXPECT_EQ(state(), RunnerState::Stopped);
}

TEST_F(RealtimeSafety, QueuesAreSafe) {
    configure([](RunnerSettings& settings) { settings.whitelist = "/texts"; });
    load(definition("Digits", "D"));
    ComponentDefinition collector = definition("Collector", "C");
    collector.remaps = {{"in", "out"}};
    collector.every = 3;
    load(collector);
    start();
    double letters = 0.0;
    for (std::uint8_t length = 0; length < 100; ++length) {
        std::vector<std::uint8_t> text(4U + length, 'x');
        std::fill_n(text.begin(), 4, std::uint8_t{0});
        text[0] = length;
        bridge().injector("/texts")->deliver(text.data(), static_cast<std::uint32_t>(text.size()));
        letters += length;
        ASSERT_TRUE(runs(6));
    }
    stop();
    EXPECT_EQ(value("/C", "letters"), letters);
}

// Messages of a component's own types have arrays, the values do not.
TEST_F(RealtimeSafety, MappedTypesOfVariableSizeAreSafe) {
    configure([](RunnerSettings& settings) { settings.whitelist = "/scan|/in"; });
    load(definition("Scanner", "S"));
    ComponentDefinition late = definition("Scanner", "L");
    late.remaps = {{"in", "scan"}, {"scan", "late"}, {"seen", "late_seen"}};
    late.breaks.ports = {"in"};
    load(late);
    start();
    for (int round = 0; round < 30; ++round) {
        ASSERT_TRUE(runs(10));
        onGraphThread([this] { return runner().probe("/S"); });
        onGraphThread([this] { return runner().takeSnapshot(); });
        const auto tap = bridge().tap("/scan");
        while (tap->pop([](const std::uint8_t*, std::uint32_t, std::int64_t) {})) {
        }
    }
    stop();
    EXPECT_EQ(state(), RunnerState::Stopped);
}

TEST_F(RealtimeSafety, SteppedCyclesAreSafe) {
    loadFig1();
    step(5000);
    EXPECT_EQ(iteration(), 5000U);
}

TEST_F(RealtimeSafety, AllocatingComponentIsCaught) {
    GTEST_FLAG_SET(death_test_style, "threadsafe");
    EXPECT_DEATH(
        {
            load(definition("Allocator", "A"));
            step(10);
        },
        "unsafe-library-call");
}

}  // namespace
}  // namespace rtcf::test
