// Changes of a graph while its loop runs: completely, at one boundary, or not at all.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstring>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "support/built_plans.hpp"
#include "support/runner_fixture.hpp"

namespace rtcf::test {
namespace {

class Change : public RunnerFixture {
   protected:
    static ComponentDefinition recorder(const std::string& name) {
        ComponentDefinition result = definition("Recorder", name);
        result.remaps = {{"in", name + "_in"}, {"out", name + "_out"}};
        return result;
    }

    void startWithA() {
        load(recorder("A"));
        start();
        ASSERT_TRUE(runs());
    }

    // Checks that a failed change left everything unchanged.
    void expectUnchanged(const std::vector<std::string>& order_before,
                         std::uint64_t generation_before) {
        EXPECT_EQ(order(), order_before);
        EXPECT_EQ(generation(), generation_before);
        EXPECT_EQ(state(), RunnerState::Running);
        EXPECT_TRUE(runs());
    }
};

TEST_F(Change, LoadedComponentRunsAndOthersKeepTheirState) {
    startWithA();
    const double before = value("/A", "out");
    const ChangeOutcome outcome = load(recorder("B"));
    EXPECT_EQ(outcome.component, "/B");
    EXPECT_EQ(outcome.order, (std::vector<std::string>{"/A", "/B"}));
    ASSERT_TRUE(runs());
    EXPECT_GT(value("/A", "out"), before);
    EXPECT_GT(value("/B", "out"), 0.0);
    EXPECT_EQ(journal().count("/A start"), 1U);
    EXPECT_EQ(journal().count("/B start"), 1U);
}

// A crash of the loaded component would end the running loop.
TEST_F(Change, ATypeThatCrashesOnInvalidValuesIsLoaded) {
    startWithA();
    load(definition("Gearbox", "G"));
    EXPECT_TRUE(runs());
    const double gear = value("/G", "gear");
    EXPECT_TRUE(gear == 10.0 || gear == 20.0) << gear;
    EXPECT_EQ(state(), RunnerState::Running);
    unload("/G");
}

TEST_F(Change, TypesThatAllocateWhenPublishedAreRejected) {
    configure([](RunnerSettings& settings) { settings.whitelist = "/trace"; });
    startWithA();
    const auto order_before = order();
    const auto generation_before = generation();
    EXPECT_EQ(errorOf([&] { load(definition("Tracer", "T")); }),
              "/T.trace cannot be published as /trace: values of rtcf_unit_test/Trace own memory, "
              "and so do messages of std_msgs/Float64MultiArray, which would be allocated in the "
              "cycle; exclude /trace from the whitelist, or store the values in a std::array");
    expectUnchanged(order_before, generation_before);
    ComponentDefinition elsewhere = definition("Tracer", "T");
    elsewhere.remaps = {{"trace", "kept"}};
    load(elsewhere);
    EXPECT_TRUE(runs());
    const std::string why =
        errorOf([&] { configure([](RunnerSettings& settings) { settings.whitelist = "/kept"; }); });
    EXPECT_NE(why.find("/T.trace cannot be published as /kept"), std::string::npos) << why;
    EXPECT_TRUE(runs());
}

TEST_F(Change, UnloadedComponentIsStoppedAndCleanedUpAfterItLeftTheLoop) {
    startWithA();
    load(recorder("B"));
    ASSERT_TRUE(runs());
    unload("/B");
    EXPECT_EQ(journal().count("/B stop"), 1U);
    EXPECT_EQ(journal().count("/B cleanup"), 1U);
    EXPECT_EQ(journal().count("/B safe"), 1U) << "although the loop continues";
    EXPECT_EQ(order(), std::vector<std::string>{"/A"});
    EXPECT_TRUE(runs());
}

TEST_F(Change, EachCycleOfAnUnchangedComponentIsCounted) {
    startWithA();
    for (int i = 0; i < 10; ++i) {
        load(recorder("B"));
        unload("/B");
    }
    stop();
    EXPECT_EQ(value("/A", "out"), static_cast<double>(iteration()))
        << "exactly one update per cycle";
}

TEST_F(Change, ReplacementTakesOverAtTheBoundary) {
    startWithA();
    replace("/A", recorder("A"));
    ASSERT_TRUE(runs());
    stop();
    EXPECT_EQ(value("/A", "out"), static_cast<double>(iteration()))
        << "it continues its predecessor's count";
    EXPECT_EQ(journal().notes(),
              (std::vector<std::string>{"/A configure", "/A start", "/A update", "/A configure",
                                        "/A start", "/A takeOver", "/A safe", "/A stop",
                                        "/A cleanup", "/A safe", "/A stop"}));
}

// A new component has no state from the replaced one: its first update() is recorded as such.
TEST_F(Change, ReplacementTakesOverBeforeItsFirstUpdate) {
    load(definition("Ticker", "T"));
    start();
    ASSERT_TRUE(runs());
    replace("/T", recorder("A"));
    ASSERT_TRUE(runs());
    EXPECT_EQ(journal().notes(),
              (std::vector<std::string>{"/A configure", "/A start", "/A takeOver", "/A update"}));
}

TEST_F(Change, ReplacementByAnotherNameTakesOverToo) {
    startWithA();
    replace("/A", recorder("B"));
    EXPECT_EQ(order(), std::vector<std::string>{"/B"});
    EXPECT_EQ(journal().count("/B takeOver"), 1U);
    EXPECT_EQ(journal().count("/A cleanup"), 1U);
    EXPECT_GT(value("/B", "out"), 0.0);
}

TEST_F(Change, RejectedReplacementLeavesTheOldOneRunning) {
    startWithA();
    const auto before = generation();
    ComponentDefinition bad = recorder("A");
    bad.parameters = {{"refuses", std::string("start")}};
    EXPECT_NE(errorOf([&] { replace("/A", bad); }), "");
    expectUnchanged({"/A"}, before);
    EXPECT_EQ(journal().count("/A takeOver"), 0U);
    EXPECT_EQ(journal().count("/A cleanup"), 1U) << "of the new component";
    EXPECT_EQ(journal().count("/A stop"), 0U);
}

TEST_F(Change, FailingConfigureIsReportedAndUndone) {
    startWithA();
    const auto before = generation();
    ComponentDefinition bad = recorder("B");
    bad.parameters = {{"refuses", std::string("configure")}};
    EXPECT_EQ(errorOf([&] { load(bad); }),
              "/B (rtcf_unit_test/Recorder): configure failed: set to refuse configure");
    expectUnchanged({"/A"}, before);
    EXPECT_EQ(journal().count("/B cleanup"), 1U);
    EXPECT_EQ(journal().count("/B start"), 0U);
}

TEST_F(Change, ThrowingConfigureIsReportedAndUndone) {
    startWithA();
    const auto before = generation();
    ComponentDefinition bad = recorder("B");
    bad.parameters = {{"throws", std::string("configure")}};
    EXPECT_EQ(errorOf([&] { load(bad); }),
              "/B (rtcf_unit_test/Recorder): configure failed: it threw: as told");
    expectUnchanged({"/A"}, before);
    EXPECT_EQ(journal().count("/B cleanup"), 1U);
}

TEST_F(Change, FailingStartIsReportedAndUndone) {
    startWithA();
    const auto before = generation();
    ComponentDefinition bad = recorder("B");
    bad.parameters = {{"refuses", std::string("start")}};
    EXPECT_NE(errorOf([&] { load(bad); }).find("start failed"), std::string::npos);
    expectUnchanged({"/A"}, before);
    EXPECT_EQ(journal().count("/B cleanup"), 1U);
    EXPECT_EQ(journal().count("/B stop"), 0U) << "it was not started";
    EXPECT_EQ(journal().count("/B update"), 0U);
}

TEST_F(Change, LoopOfConnectionsIsRejectedAndTheNewComponentCleanedUpOnce) {
    startWithA();
    const auto before = generation();
    ComponentDefinition closing = recorder("B");
    closing.remaps = {{"in", "A_out"}, {"out", "A_in"}};
    const std::string text = errorOf([&] { load(closing); });
    EXPECT_NE(text.find("the connections form a loop"), std::string::npos) << text;
    expectUnchanged({"/A"}, before);
    EXPECT_EQ(journal().count("/B configure"), 1U);
    EXPECT_EQ(journal().count("/B cleanup"), 1U);
    EXPECT_EQ(journal().count("/B start"), 0U);
}

TEST_F(Change, UnbreakThatWouldCloseALoopIsRejected) {
    startWithA();
    ComponentDefinition closing = recorder("B");
    closing.remaps = {{"in", "A_out"}, {"out", "A_in"}};
    closing.breaks.ports = {"in"};
    load(closing);
    EXPECT_EQ(order(), (std::vector<std::string>{"/B", "/A"}));
    const auto before = generation();
    EXPECT_NE(errorOf([&] { setBreak("/B", "in", false); }), "");
    expectUnchanged({"/B", "/A"}, before);
}

TEST_F(Change, BreaksChangeTheOrderOfARunningLoop) {
    startWithA();
    ComponentDefinition closing = recorder("B");
    closing.remaps = {{"in", "A_out"}, {"out", "A_in"}};
    closing.breaks.ports = {"in"};
    load(closing);
    setBreak("/A", "in", true);
    setBreak("/B", "in", false);
    EXPECT_EQ(order(), (std::vector<std::string>{"/A", "/B"}));
    ASSERT_TRUE(runs());
    stop();
    EXPECT_EQ(value("/A", "out"), static_cast<double>(iteration()));
}

TEST_F(Change, TakenNameIsRejectedBeforeConstruction) {
    startWithA();
    const auto before = generation();
    const std::string text = errorOf([&] { load(recorder("A")); });
    EXPECT_NE(text.find("/A is loaded already"), std::string::npos) << text;
    EXPECT_EQ(journal().count("/A configure"), 1U);
    expectUnchanged({"/A"}, before);
}

TEST_F(Change, UnknownTypeIsRejectedWithTheExistingTypes) {
    const std::string text = errorOf([&] { load(definition("Nothing", "N")); });
    EXPECT_NE(text.find("no component type Nothing; it has"), std::string::npos) << text;
    EXPECT_NE(text.find("Recorder"), std::string::npos) << text;
}

TEST_F(Change, BadLoadTimeParameterIsRejectedBeforeConfigure) {
    startWithA();
    ComponentDefinition bad = recorder("B");
    bad.parameters = {{"gain", 11.0}};
    EXPECT_EQ(errorOf([&] { load(bad); }), "/B: parameter gain = 11 is above its maximum 10 ");
    EXPECT_EQ(journal().count("/B configure"), 0U);
}

TEST_F(Change, BatchOfParametersIsSetInOneCycle) {
    startWithA();
    setParameters("/A", {{"gain", 2.0}, {"refuses", std::string("nothing")}});
    ASSERT_TRUE(runs());
    stop();
    EXPECT_EQ(value("/A", "out"), 2.0 * static_cast<double>(iteration()));
}

// A change of one number must not replan a graph of thousands of components.
TEST_F(Change, ValuesOfParametersNeedNoNewSchedule) {
    startWithA();
    const std::size_t before = builtPlans().count;
    setParameters("/A", {{"gain", 2.0}});
    setParameters("/A", {{"gain", 3.0}, {"limit", 4.0}});
    EXPECT_EQ(builtPlans().count, before);
    load(recorder("B"));
    EXPECT_EQ(builtPlans().count, before + 1) << "a change of the graph is planned again";
}

TEST_F(Change, AFixedParameterIsSetAtTheLoadOnly) {
    ComponentDefinition a = recorder("A");
    a.parameters = {{"device", std::string("can0")}};
    load(a);
    start();
    const std::string text =
        errorOf([&] { setParameters("/A", {{"gain", 2.0}, {"device", std::string("can1")}}); });
    EXPECT_EQ(
        text.rfind("/A: parameter device is fixed at the load: `rtcfctl replace` with --param "
                   "device:=can1",
                   0),
        0U)
        << text;
    ASSERT_TRUE(runs());
    setParameters("/A", {{"gain", 2.0}, {"device", std::string("can0")}});  // the same value
    ComponentDefinition next = recorder("A");
    next.parameters = {{"device", std::string("can1")}};
    replace("/A", next);
    EXPECT_EQ(errorOf([&] { setParameters("/A", {{"device", std::string("can1")}}); }), "");
}

TEST_F(Change, BatchWithABadValueSetsNothing) {
    startWithA();
    const std::string text =
        errorOf([&] { setParameters("/A", {{"gain", 2.0}, {"throws_at", 1.5}}); });
    EXPECT_NE(text.find("throws_at"), std::string::npos) << text;
    EXPECT_NE(
        errorOf([&] { setParameters("/A", {{"gain", 3.0}, {"nonsense", 1.0}}); }).find("nonsense"),
        std::string::npos);
    ASSERT_TRUE(runs());
    stop();
    EXPECT_EQ(value("/A", "out"), static_cast<double>(iteration())) << "the gain is still 1";
    const auto graph = runner().graph();
    for (const auto& parameter : graph->get("/A").parameters) {
        if (parameter.declaration.name == "gain") {
            EXPECT_EQ(std::get<double>(parameter.value), 1.0);
        }
    }
}

TEST_F(Change, FrequencyChangesWhileTheLoopRuns) {
    startWithA();
    configure([](RunnerSettings& settings) { settings.frequency_hz = 500.0; });
    ASSERT_TRUE(runs());
    EXPECT_EQ(runner().loop().clock().period_ns, 2'000'000);
    EXPECT_EQ(journal().count("/A start"), 1U);
}

TEST_F(Change, EachDesignPeriodOfAComponentFollowsTheFrequency) {
    load(definition("DesignedTwice", "D"));
    start();
    for (const double frequency : {1000.0, 500.0, 2000.0}) {
        configure([&](RunnerSettings& settings) { settings.frequency_hz = frequency; });
        ASSERT_TRUE(runs(3));
        EXPECT_EQ(value("/D", "own"), 1.0 / frequency);
        EXPECT_EQ(value("/D", "base"), 1.0 / frequency) << "that of the base class";
    }
}

TEST_F(Change, ElapsedStaysConsistentWhenTheFrequencyChanges) {
    load(definition("Stopwatch", "W"));
    start();
    for (const double frequency : {10.0, 1000.0, 300.0, 1000.0}) {
        ASSERT_TRUE(runs(3));
        configure([&](RunnerSettings& settings) { settings.frequency_hz = frequency; });
        ASSERT_TRUE(runs(3));
        EXPECT_EQ(value("/W", "furthest_off"), 0.0) << "from then on at " << frequency << " Hz";
    }
}

TEST_F(Change, AFrequencyChangedBetweenStepsAppliesToTheNextOne) {
    load(definition("Stopwatch", "W"));
    for (const double frequency : {1000.0, 10.0, 1000.0}) {
        configure([&](RunnerSettings& settings) { settings.frequency_hz = frequency; });
        step(2);
        EXPECT_EQ(value("/W", "furthest_off"), 0.0);
        EXPECT_EQ(value("/W", "last"), 1e9 / frequency);
    }
}

TEST_F(Change, BadSettingsAreRejectedAndTheOldOnesStay) {
    startWithA();
    EXPECT_NE(errorOf([&] { configure([](RunnerSettings& s) { s.frequency_hz = std::nan(""); }); }),
              "");
    EXPECT_NE(errorOf([&] { configure([](RunnerSettings& s) { s.whitelist = "("; }); }), "");
    EXPECT_NE(errorOf([&] { configure([](RunnerSettings& s) { s.loop.realtime.priority = 99; }); }),
              "");
    EXPECT_EQ(runner().status().settings.frequency_hz, 1000.0);
    EXPECT_TRUE(runs());
}

TEST_F(Change, TopicsFollowTheWhitelistOfARunningLoop) {
    startWithA();
    EXPECT_EQ(bridge().tap("/A_out"), nullptr);
    configure([](RunnerSettings& settings) { settings.whitelist = "/A_.*"; });
    ASSERT_NE(bridge().tap("/A_out"), nullptr);
    ASSERT_NE(bridge().injector("/A_in"), nullptr);
    const auto tap = bridge().tap("/A_out");
    EXPECT_TRUE(eventually(
        [&] { return tap->pop([](const std::uint8_t*, std::uint32_t, std::int64_t) {}); }));
    load(recorder("B"));
    EXPECT_EQ(bridge().tap("/A_out"), tap) << "unchanged topics keep their taps";
}

// Through changes of the graph, and through a stop and a start.
TEST_F(Change, EachValueIsPublishedOnce) {
    configure([](RunnerSettings& settings) { settings.whitelist = "/T_out"; });
    ComponentDefinition ticker = definition("Ticker", "T");
    ticker.remaps = {{"out", "T_out"}};
    load(ticker);
    const auto tap = bridge().tap("/T_out");
    ASSERT_NE(tap, nullptr);
    start();
    std::atomic<bool> done{false};
    std::vector<double> taken;
    std::thread reader([&] {
        for (bool last = false; !last;) {
            last = done;
            while (tap->pop([&](const std::uint8_t* bytes, std::uint32_t size, std::int64_t) {
                ASSERT_EQ(size, sizeof(double));
                std::memcpy(&taken.emplace_back(), bytes, size);
            })) {
            }
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
    });
    for (int i = 0; i < 20; ++i) {
        load(recorder("B"));
        EXPECT_TRUE(runs(3));
        if (i % 5 == 4) {
            stop();
            start();
        }
        unload("/B");
        EXPECT_TRUE(runs(3));
    }
    stop();
    done = true;
    reader.join();
    EXPECT_EQ(tap->dropped(), 0U);
    ASSERT_GT(taken.size(), 100U);
    EXPECT_EQ(std::count(taken.begin(), taken.end(), 0.0), 5) << "the first cycles of five loops";
    for (std::size_t i = 1; i < taken.size(); ++i) {
        if (taken[i] != 0.0) {
            EXPECT_EQ(taken[i], taken[i - 1] + 1.0);
        }
    }
}

// A restoration changes neither graph nor frames, and its values have old stamps.
TEST_F(Change, EachValueIsPublishedOnceThroughRestorations) {
    constexpr int kRestorations = 30;
    configure([](RunnerSettings& settings) {
        settings.whitelist = "/T_out";
        settings.frequency_hz = 2000.0;
    });
    ComponentDefinition ticker = definition("Ticker", "T");
    ticker.remaps = {{"out", "T_out"}};
    load(ticker);
    const auto tap = bridge().tap("/T_out");
    ASSERT_NE(tap, nullptr);
    start();
    ASSERT_TRUE(runs());
    const auto snapshot = onGraphThread([&] { return runner().takeSnapshot().snapshot; });
    std::atomic<bool> done{false};
    std::vector<double> taken;
    std::thread reader([&] {
        for (bool last = false; !last;) {
            last = done;
            while (tap->pop([&](const std::uint8_t* bytes, std::uint32_t size, std::int64_t) {
                std::memcpy(&taken.emplace_back(), bytes, size);
            })) {
            }
        }
    });
    for (int i = 0; i < kRestorations; ++i) {
        EXPECT_TRUE(runs(5));
        onGraphThread([&] { return runner().restore(snapshot, [](const std::string&) {}); });
    }
    stop();
    done = true;
    reader.join();
    EXPECT_EQ(tap->dropped(), 0U);
    int back = 0;
    for (std::size_t i = 1; i < taken.size(); ++i) back += taken[i] == taken[i - 1] + 1.0 ? 0 : 1;
    EXPECT_EQ(back, kRestorations);
}

// A message may come while a change is made, or while the cycle looks for one.
TEST_F(Change, ALoopSeesTheLastMessage) {
    startWithA();
    configure([](RunnerSettings& settings) { settings.whitelist = "/A_in"; });
    const auto injector = bridge().injector("/A_in");
    ASSERT_NE(injector, nullptr);
    std::atomic<bool> sends{true};
    std::atomic<bool> done{false};
    std::atomic<double> sent{0.0};
    std::thread sender([&] {
        while (!done) {
            if (sends) {
                const double number = sent + 1.0;
                std::uint8_t bytes[sizeof number];
                std::memcpy(bytes, &number, sizeof number);
                EXPECT_TRUE(injector->deliver(bytes, sizeof bytes));
                sent = number;
            } else {
                std::this_thread::sleep_for(std::chrono::microseconds(100));
            }
        }
    });
    for (int i = 0; i < 20; ++i) {
        load(recorder("B"));
        sends = false;
        EXPECT_TRUE(eventually([&] { return value("/A", "in") == sent; })) << "round " << i;
        sends = true;
        unload("/B");
    }
    done = true;
    sender.join();
}

// A writer in the loop ends an input's subscription; its unload restores it.
TEST_F(Change, InputIsSubscribedOnlyWithoutAWriter) {
    startWithA();
    configure([](RunnerSettings& settings) { settings.whitelist = "/A_in"; });
    ASSERT_NE(bridge().injector("/A_in"), nullptr);
    ComponentDefinition writer = definition("Ticker", "W");
    writer.remaps = {{"out", "A_in"}};
    load(writer);
    EXPECT_EQ(bridge().injector("/A_in"), nullptr);
    EXPECT_NE(bridge().tap("/A_in"), nullptr);
    unload("/W");
    EXPECT_NE(bridge().injector("/A_in"), nullptr);
    EXPECT_TRUE(runs());
}

// The same number in two types: a connection between them needs neither conversion nor component.
TEST_F(Change, OutputOfADoubleFeedsAFloat64) {
    ComponentDefinition writer = definition("Stateful", "A");
    writer.remaps = {{"out", "x"}};
    onGraphThread([&] {
        return runner().load(writer, RTCF_UNIT_COMPONENTS "/stateful_1.so",
                             [](const std::string&) {});
    });
    ComponentDefinition reader = definition("Recorder", "B");
    reader.remaps = {{"in", "x"}};
    load(reader);
    step(4);
    EXPECT_EQ(value("/B", "in"), 4.0);
}

TEST_F(Change, StructsOfTwoBuildsAreComparedByTheirFields) {
    const auto loadFrom = [&](int version, const std::string& type, const std::string& name,
                              const std::set<std::string>& connected) {
        ComponentDefinition component = definition(type, name);
        for (const char* port : {"command", "target", "limits"}) {
            const std::string own = connected.count(port) != 0 ? "" : name + "_";
            component.remaps.emplace_back(port, own + port);
        }
        const std::string file =
            RTCF_UNIT_COMPONENTS "/versioned_" + std::to_string(version) + ".so";
        return errorOf([&] {
            onGraphThread(
                [&] { return runner().load(component, file, [](const std::string&) {}); });
        });
    };
    EXPECT_EQ(loadFrom(1, "Sender", "S", {"command", "target", "limits"}), "");
    EXPECT_EQ(loadFrom(1, "Receiver", "A", {"command", "target", "limits"}), "");
    EXPECT_EQ(loadFrom(2, "Receiver", "B", {"limits"}), "") << "the fields are the same";
    const std::string target = loadFrom(2, "Receiver", "C", {"target"});
    EXPECT_NE(target.find("types differ on /target: "), std::string::npos) << target;
    EXPECT_EQ(loadFrom(2, "Receiver", "C", {"command"}),
              "types differ on /command: /S.command and /C.command are "
              "(anonymous namespace)::Command of different source files or builds; name the "
              "fields of the struct, or declare it in a header, in a named namespace");
}

// 16 values, not the 1000 of half a second: frames are locked memory.
TEST_F(Change, FramesOfALargeTypeAreBoundedInBytes) {
    configure([](RunnerSettings& settings) {
        settings.whitelist = ".*";
        settings.frequency_hz = 2000.0;
    });
    load(definition("Camera", "B"));
    step(40);
    const auto tap = bridge().tap("/image");
    ASSERT_NE(tap, nullptr);
    const auto use = [](const std::uint8_t*, std::uint32_t size, std::int64_t) {
        EXPECT_EQ(size, 1024U * 1024U);
    };
    std::size_t taken = 0;
    while (tap->pop(use)) ++taken;
    EXPECT_GE(taken, 10U);
    EXPECT_EQ(taken + tap->dropped(), 40U);
    EXPECT_GE(tap->dropped(), 20U);
}

// 16 MiB each.
TEST_F(Change, RingsOfVariableSizeAreBoundedInTotal) {
    configure([](RunnerSettings& settings) {
        settings.whitelist = ".*";
        settings.bridge.largest_message = 8 * 1024 * 1024 - 24;
    });
    const auto writer = [](int number) {
        ComponentDefinition each = definition("Talker", "W" + std::to_string(number));
        each.remaps = {{"out", "text_" + std::to_string(number)}};
        return each;
    };
    for (int number = 1; number <= 16; ++number) load(writer(number));
    try {
        load(writer(17));
        FAIL() << "no error";
    } catch (const Error& refused) {
        EXPECT_EQ(refused.kind(), executor::ErrorKind::ResourceExhausted);
        const std::string text = refused.what();
        EXPECT_NE(text.find("more than the 256 MiB of locked memory"), std::string::npos) << text;
        EXPECT_EQ(text.find('\n'), std::string::npos) << text;
    }
    EXPECT_EQ(order().size(), 16U);
    EXPECT_EQ(bridge().tap("/text_17"), nullptr);
    unload("/W1");
    load(writer(17));
    EXPECT_NE(bridge().tap("/text_17"), nullptr);
}

}  // namespace
}  // namespace rtcf::test
