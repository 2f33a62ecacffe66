// The last cycle: values written by safe(), their readers, and the time of the call. The typical
// case is a driver that loses its controller.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <optional>

#include "rtcf/port.hpp"
#include "support/built_plans.hpp"
#include "support/runner_fixture.hpp"

namespace rtcf::test {
namespace {

class Safe : public RunnerFixture {
   protected:
    static ComponentDefinition controller(const std::string& name,
                                          const std::string& wired = "effort") {
        ComponentDefinition result = definition("Controller", name);
        for (const std::string port : {"effort", "other", "checked", "vital"})
            result.remaps.emplace_back(port, port == wired ? "command" : name + "_" + port);
        return result;
    }

    static ComponentDefinition driver(const std::string& name = "D") {
        ComponentDefinition result = definition("Driver", name);
        result.remaps = {{"command", "/command"}};
        for (const char* port : {"applied", "held", "lowest", "last_status", "zeros", "periods"})
            result.remaps.emplace_back(port, name + "_" + port);
        return result;
    }

    // Maps everything, in a loop so slow that no ring fills up before the test reads it.
    void mapEverything() {
        configure([](RunnerSettings& settings) {
            settings.whitelist = ".*";
            settings.frequency_hz = 10.0;
        });
    }

    // The newest value of a tap for the ROS node.
    std::optional<double> published(const std::shared_ptr<executor::Tap>& tap) {
        std::optional<double> last;
        while (tap->pop([&](const std::uint8_t* bytes, std::uint32_t size, std::int64_t) {
            double value = 0.0;
            if (size == sizeof value) std::memcpy(&value, bytes, size);
            last = value;
        })) {
        }
        return last;
    }

    bool toldNotFinite(const std::string& port) {
        return eventually([&] {
            const auto all = events();
            return std::any_of(all.begin(), all.end(), [&](const RunnerEvent& event) {
                return event.message.find("output " + port + " is not finite") != std::string::npos;
            });
        });
    }

    double applied(const std::string& name = "/D") { return value(name, "applied"); }

    static std::size_t position(const std::vector<std::string>& notes, const std::string& note) {
        return static_cast<std::size_t>(std::find(notes.begin(), notes.end(), note) -
                                        notes.begin());
    }
};

TEST_F(Safe, CommandsOfTheControllerReachTheDriverAndRos) {
    load(controller("C"));
    load(driver());
    start();
    ASSERT_TRUE(runs());
    EXPECT_EQ(applied(), 5.0);
    mapEverything();
    stop();
    EXPECT_EQ(applied(), 0.0) << "its safe() reads after the controller's";
    EXPECT_EQ(value("/D", "zeros"), 1.0);
    EXPECT_EQ(published(bridge().tap("/command")), 0.0);
    EXPECT_EQ(published(bridge().tap("/D_applied")), 0.0);
}

TEST_F(Safe, CheckedOutputsAreCommitted) {
    load(controller("C", "checked"));
    load(driver());
    start();
    ASSERT_TRUE(runs());
    stop();
    EXPECT_EQ(applied(), 0.0);
}

TEST_F(Safe, NonFiniteValuesAreHeldBackAndReported) {
    ComponentDefinition wild = controller("C", "checked");
    wild.parameters = {{"wild", true}};
    load(wild);
    load(driver());
    start();
    ASSERT_TRUE(runs());
    stop();
    EXPECT_EQ(applied(), 5.0);
    EXPECT_EQ(state(), RunnerState::Stopped);
    EXPECT_TRUE(toldNotFinite("checked"));
}

// Its outputs can end the loop that it belongs to, but not after it left.
TEST_F(Safe, FaultsOfALeavingComponentDoNotEndTheLoop) {
    ComponentDefinition wild = controller("C", "vital");
    wild.parameters = {{"wild", true}};
    load(wild);
    load(driver());
    start();
    ASSERT_TRUE(runs());
    replace("/C", wild);
    ASSERT_TRUE(runs());
    EXPECT_EQ(applied(), 5.0);
    unload("/C");
    ASSERT_TRUE(runs());
    EXPECT_EQ(journal().count("/C safe"), 2U);
    EXPECT_EQ(applied(), 5.0) << "the last finite one";
    EXPECT_EQ(state(), RunnerState::Running);
    EXPECT_TRUE(toldNotFinite("checked")) << "the first non-finite output";
}

TEST_F(Safe, IsCalledOnTheCulprit) {
    ComponentDefinition throwing = controller("C");
    throwing.parameters = {{"throws_at", std::int64_t{15}}};
    load(throwing);
    load(driver());
    start();
    ASSERT_TRUE(eventually([this] { return state() == RunnerState::Faulted; }));
    EXPECT_EQ(journal().count("/C safe"), 1U);
    EXPECT_EQ(journal().count("/D safe"), 1U);
    EXPECT_EQ(applied(), 0.0);
}

TEST_F(Safe, InputOfThePreviousCycleIsCorrectInTheLastOne) {
    load(controller("C"));
    ComponentDefinition early = driver();
    early.breaks.first = true;
    load(early);
    ASSERT_EQ(order(), (std::vector<std::string>{"/D", "/C"}));
    step(3);
    stop();
    // It runs before the controller, so it has the command of the previous cycle, as always.
    EXPECT_EQ(applied(), 5.0);
    EXPECT_EQ(value("/C", "effort"), 0.0);
}

TEST_F(Safe, UnloadFromARunningLoopLeavesTheDriverASafeCommand) {
    load(controller("C"));
    load(driver());
    start();
    ASSERT_TRUE(runs());
    mapEverything();
    const auto tap = bridge().tap("/command");
    unload("/C");
    ASSERT_TRUE(runs(3));
    EXPECT_EQ(state(), RunnerState::Running);
    EXPECT_EQ(applied(), 0.0);
    EXPECT_EQ(value("/D", "zeros"), 1.0) << "as new data, once";
    EXPECT_EQ(journal().count("/C safe"), 1U);
    EXPECT_EQ(published(tap), 0.0);
    stop();
    EXPECT_EQ(journal().count("/C safe"), 1U);
}

TEST_F(Safe, UnloadLeavesASafeCommandInTheCycleBefore) {
    load(controller("C"));
    load(driver());
    setBreak("/D", "command", true);  // it reads the value from before the controller ran
    start();
    ASSERT_TRUE(runs());
    unload("/C");
    ASSERT_TRUE(runs(3));
    EXPECT_EQ(applied(), 0.0);
}

TEST_F(Safe, ReplacedControllerHandsOverWithoutAnInterruption) {
    load(controller("C"));
    load(driver());
    start();
    ASSERT_TRUE(runs());
    replace("/C", controller("C"));
    ASSERT_TRUE(runs(3));
    EXPECT_EQ(applied(), 5.0);
    EXPECT_EQ(value("/D", "lowest"), 5.0) << "the successor writes in the same cycle";
    const auto notes = journal().notes();
    EXPECT_LT(position(notes, "/C takeOver"), position(notes, "/C safe"))
        << "the successor sees the state before safe()";
    EXPECT_EQ(journal().count("/C safe"), 1U);
}

TEST_F(Safe, ReplacementThatWritesNothingLeavesASafeCommand) {
    load(controller("C"));
    load(driver());
    start();
    ASSERT_TRUE(runs());
    ComponentDefinition silent = controller("C");
    silent.parameters = {{"silent", true}};
    replace("/C", silent);
    ASSERT_TRUE(runs(3));
    EXPECT_EQ(applied(), 0.0);
    EXPECT_EQ(value("/D", "zeros"), 1.0);
    EXPECT_EQ(value("/D", "last_status"), static_cast<double>(DataStatus::Old));
}

TEST_F(Safe, OfALeavingComponentSeesTheTimeOfItsOwnCycle) {
    for (const char* name : {"A", "B", "C", "D"}) {
        ComponentDefinition watch = definition("Stopwatch", name);
        watch.remaps = {{"furthest_off", std::string(name) + "_off"},
                        {"last", std::string(name) + "_last"}};
        load(watch);
    }
    step(3);
    unload("/A");
    step(1);
    stop();
    start();
    ASSERT_TRUE(runs());
    unload("/B");
    ComponentDefinition successor = definition("Stopwatch", "C");
    successor.remaps = {{"furthest_off", "C_off"}, {"last", "C_last"}};
    replace("/C", successor);
    ASSERT_TRUE(runs());
    EXPECT_EQ(journal().count("/A safe later"), 1U) << "between two steps";
    EXPECT_EQ(journal().count("/B safe later"), 2U) << "at the end of the steps, and in the loop";
    EXPECT_EQ(journal().count("/C safe later"), 2U);
    EXPECT_EQ(value("/D", "furthest_off"), 0.0) << "other components see the same times";
}

// The new controller runs after the driver, so the driver has not had a turn to read its value.
TEST_F(Safe, OfALeavingDriverReadsTheFirstValueOfANewController) {
    ComponentDefinition silent = controller("B");
    silent.parameters = {{"silent", true}};
    load(silent);
    ComponentDefinition early = driver();
    early.breaks.first = true;
    load(early);
    ComponentDefinition watching = definition("Watcher", "W");
    watching.remaps = {{"in", "D_applied"}, {"highest", "W_highest"}};
    load(watching);
    step(1);
    unload("/B");
    step(1);
    ASSERT_EQ(value("/W", "highest"), 0.0) << "the safe command of the first controller";
    load(controller("C"));
    step(1);
    ASSERT_EQ(value("/W", "highest"), 0.0);
    unload("/D");
    step(1);
    EXPECT_EQ(value("/W", "highest"), 5.0);
}

TEST_F(Safe, IsNotCalledAgainOnceTheLoopHasEnded) {
    load(controller("C"));
    start();
    ASSERT_TRUE(runs());
    stop();
    unload("/C");
    EXPECT_EQ(journal().count("/C safe"), 1U);
}

TEST_F(Safe, OptionalControllerThatThrowsMakesSafeInTheSameCycle) {
    ComponentDefinition throwing = controller("C");
    throwing.optional = true;
    throwing.parameters = {{"throws_at", std::int64_t{15}}};
    load(throwing);
    load(driver());
    step(15);
    EXPECT_EQ(applied(), 5.0);
    step(1);
    EXPECT_EQ(state(), RunnerState::Stepping);
    EXPECT_EQ(applied(), 0.0) << "the components after it run in that cycle";
    EXPECT_EQ(value("/D", "periods"), 1.0);
    step(5);
    EXPECT_EQ(value("/D", "zeros"), 1.0);
    stop();
    EXPECT_EQ(journal().count("/C safe"), 1U) << "when it was taken out";
    EXPECT_EQ(journal().count("/D safe"), 1U);
}

// A feature of few components costs time in a cycle only while one of them is loaded.
TEST_F(Safe, CyclesAreFastAgainAfterTheUnloadOfAnOptionalComponent) {
    ComponentDefinition plain = definition("Ticker", "T");
    load(plain);
    EXPECT_FALSE(builtPlans().selective);
    ComponentDefinition throwing = definition("Recorder", "C");
    throwing.optional = true;
    throwing.remaps = {{"in", "C_in"}, {"out", "C_out"}};
    throwing.parameters = {{"throws_at", std::int64_t{15}}};
    load(throwing);
    EXPECT_TRUE(builtPlans().selective);
    step(20);
    ASSERT_EQ(journal().count("/C safe"), 1U) << "the component is taken out";
    unload("/C");
    EXPECT_FALSE(builtPlans().selective);
    step(5);
    EXPECT_EQ(state(), RunnerState::Stepping);
    EXPECT_EQ(value("/T", "out"), 24.0);
}

// Values written before the throw are never seen: `other` by write(), `effort` in place.
TEST_F(Safe, PartialOutputOfAThrowingOptionalComponentIsNotSeen) {
    for (const std::string port : {"effort", "other", "checked"}) {
        ComponentDefinition throwing = controller("C_" + port, port);
        throwing.optional = true;
        throwing.parameters = {{"throws_at", std::int64_t{3}}};
        load(throwing);
        ComponentDefinition looking = definition("Watcher", "W_" + port);
        looking.remaps = {{"in", "command"}, {"highest", "W_" + port + "_highest"}};
        load(looking);
        step(10);
        EXPECT_EQ(value("/W_" + port, "highest"), 5.0) << port;
        stop();
        unload("/C_" + port);
        unload("/W_" + port);
    }
}

// The loop ends: the driver's last input, in safe(), is the command of the previous cycle.
TEST_F(Safe, PartialOutputOfAThrowingControllerReachesNoDriver) {
    for (const std::string port : {"effort", "other", "checked"}) {
        ComponentDefinition throwing = controller("C_" + port, port);
        throwing.parameters = {{"throws_at", std::int64_t{3}}, {"keeps", true}};
        load(throwing);
        load(driver("D_" + port));
        step(3);
        EXPECT_EQ(value("/D_" + port, "held"), 5.0) << port;
        step(1);
        ASSERT_EQ(state(), RunnerState::Faulted) << port;
        EXPECT_EQ(value("/D_" + port, "held"), 5.0) << port;
        EXPECT_EQ(value("/D_" + port, "applied"), 5.0) << port;
        EXPECT_EQ(value("/D_" + port, "last_status"), static_cast<double>(DataStatus::Old)) << port;
        unload("/C_" + port);
        unload("/D_" + port);
    }
}

// Its value of the previous cycles is there, although the driver has not run so far.
TEST_F(Safe, PartialOutputOfAThrowingControllerLeavesASlowDriverItsValue) {
    ComponentDefinition throwing = controller("C", "other");
    throwing.parameters = {{"throws_at", std::int64_t{3}}, {"keeps", true}};
    load(throwing);
    ComponentDefinition slow = driver();
    slow.every = 8;
    slow.phase = 7;
    load(slow);
    step(4);
    ASSERT_EQ(state(), RunnerState::Faulted);
    EXPECT_EQ(value("/D", "held"), 5.0);
    EXPECT_EQ(value("/D", "last_status"), static_cast<double>(DataStatus::New));
}

TEST_F(Safe, PartialOutputOfTheFirstCycleIsNoValue) {
    ComponentDefinition throwing = controller("C", "other");
    throwing.parameters = {{"throws_at", std::int64_t{0}}, {"keeps", true}};
    load(throwing);
    load(driver());
    start();
    ASSERT_TRUE(eventually([this] { return state() == RunnerState::Faulted; }));
    EXPECT_EQ(value("/D", "last_status"), static_cast<double>(DataStatus::None));
}

TEST_F(Safe, PartialTextsAndLargeValuesAreNotRead) {
    ComponentDefinition throwing = definition("Author", "A");
    throwing.parameters = {{"throws_at", std::int64_t{3}}};
    load(throwing);
    load(definition("Critic", "C"));
    step(3);
    EXPECT_EQ(value("/C", "whole"), 2.0);
    step(1);
    ASSERT_EQ(state(), RunnerState::Faulted);
    EXPECT_EQ(value("/C", "whole"), 2.0);
}

// Unwatched values are restored, too.
TEST_F(Safe, PartialOutputIsNotReadWithoutFrames) {
    configure([](RunnerSettings& settings) { settings.frame_bytes = 0; });
    ComponentDefinition throwing = controller("C", "effort");
    throwing.parameters = {{"throws_at", std::int64_t{3}}, {"keeps", true}};
    load(throwing);
    load(driver());
    step(4);
    ASSERT_EQ(state(), RunnerState::Faulted);
    EXPECT_EQ(value("/D", "held"), 5.0);
}

// The same for values not taken yet: no topic and no queue gets them as a message.
TEST_F(Safe, PartialOutputOfAThrowingControllerIsNoMessage) {
    ComponentDefinition throwing = controller("C", "other");
    throwing.parameters = {{"throws_at", std::int64_t{3}}, {"keeps", true}};
    load(throwing);
    ComponentDefinition collector = definition("Collector", "Q");
    collector.remaps = {{"in", "command"}};
    load(collector);
    mapEverything();
    step(3);
    EXPECT_EQ(value("/Q", "order"), 555.0);
    while (bridge().tap("/command")->pop([](const std::uint8_t*, std::uint32_t, std::int64_t) {})) {
    }
    step(1);
    ASSERT_EQ(state(), RunnerState::Faulted);
    EXPECT_FALSE(published(bridge().tap("/command")).has_value());
    EXPECT_EQ(value("/Q", "waiting"), 0.0);
}

TEST_F(Safe, NothingIsTakenOverFromAThrowingComponent) {
    ComponentDefinition throwing = controller("C");
    throwing.optional = true;
    throwing.parameters = {{"throws_at", std::int64_t{15}}};
    load(throwing);
    start();
    ASSERT_TRUE(runs());
    ComponentDefinition sound = controller("C");
    sound.parameters = {{"throws_at", std::int64_t{-1}}};
    replace("/C", sound);
    EXPECT_EQ(journal().count("/C takeOver"), 0U);
    replace("/C", sound);
    EXPECT_EQ(journal().count("/C takeOver"), 1U);
}

// The component of docs/components.md, verbatim.
TEST_F(Safe, ExampleOfTheDocumentationCommandsZero) {
    ComponentDefinition pi = definition("Pi", "pi");
    pi.remaps = {{"effort", "command"}, {"setpoint", "C_effort"}, {"measured", "C_other"}};
    load(controller("C", "checked_by_nobody"));
    load(pi);
    load(driver());
    start();
    ASSERT_TRUE(runs());
    stop();
    EXPECT_EQ(value("/pi", "effort"), 0.0);
    EXPECT_EQ(applied(), 0.0);
}

// Readers of an optional component's outputs see a copy.
class FirstValues : public RunnerFixture, public ::testing::WithParamInterface<bool> {};

TEST_P(FirstValues, OfStartAreReadInTheFirstCycle) {
    ComponentDefinition herald = definition("Herald", "H");
    herald.optional = GetParam();
    load(herald);
    ComponentDefinition relay = definition("Relay", "R");
    relay.remaps = {{"in", "announced"}};
    load(relay);
    step(1);
    EXPECT_EQ(value("/H", "announced"), 7.0);
    EXPECT_EQ(value("/H", "counted"), 1.0);
    EXPECT_EQ(value("/R", "out"), 8.0);
    step(2);
    EXPECT_EQ(value("/H", "counted"), 3.0) << "by a reference from configure()";
}

// Also by a reader with a loop break, which has a copy since it was loaded.
TEST_P(FirstValues, OfStartReplaceThoseOfConfigure) {
    ComponentDefinition herald = definition("Herald", "H");
    herald.optional = GetParam();
    load(herald);
    for (const std::string name : {"R", "Z"}) {
        ComponentDefinition relay = definition("Relay", name);
        relay.remaps = {{"in", "announced"}, {"out", name + "_out"}, {"status", name + "_status"}};
        if (name == "Z") relay.breaks.ports = {"in"};
        load(relay);
    }
    ASSERT_EQ(order(), (std::vector<std::string>{"/H", "/R", "/Z"}));
    step(1);
    EXPECT_EQ(value("/R", "out"), 8.0);
    EXPECT_EQ(value("/Z", "out"), 8.0);
}

INSTANTIATE_TEST_SUITE_P(Safe, FirstValues, ::testing::Bool());

}  // namespace
}  // namespace rtcf::test
