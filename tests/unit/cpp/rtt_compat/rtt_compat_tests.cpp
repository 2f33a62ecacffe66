// Components written for RTCF 2021, in a real runner. In the build with RealtimeSanitizer
// each of these tests also tests real-time safety.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/runner_fixture.hpp"

namespace rtcf::test {
namespace {

constexpr double kNoData = 0.0;
constexpr double kOldData = 1.0;
constexpr double kNewData = 2.0;

class RttCompat : public RunnerFixture {
   protected:
    ChangeOutcome loadOld(const std::string& type, const std::string& name,
                          executor::Remaps remaps = {}) {
        return loadFrom(RTCF_UNIT_COMPONENTS "/old_style.so", type, name, std::move(remaps));
    }
    ChangeOutcome loadApi(const std::string& type, const std::string& name,
                          executor::Remaps remaps = {}) {
        return loadFrom(RTCF_UNIT_COMPONENTS "/old_api.so", type, name, std::move(remaps));
    }
    ChangeOutcome loadFrom(const std::string& library, const std::string& type,
                           const std::string& name, executor::Remaps remaps) {
        ComponentDefinition component = definition(type, name);
        component.remaps = std::move(remaps);
        return onGraphThread(
            [&] { return runner().load(component, library, [](const std::string&) {}); });
    }

    // The log messages of a component, in order.
    std::vector<std::string> said(const std::string& component) {
        std::vector<std::string> lines;
        for (const LogEntry& entry : logged()) {
            if (entry.component == component) lines.push_back(entry.message);
        }
        return lines;
    }
    bool hasSaid(const std::string& component, const std::string& line) {
        const std::vector<std::string> lines = said(component);
        return std::find(lines.begin(), lines.end(), line) != lines.end();
    }
};

TEST_F(RttCompat, PortsOfConstructorAndConfigureHookExist) {
    loadOld("Reader", "R");
    std::vector<std::string> names;
    const auto graph = runner().graph();
    for (const auto& port : *graph->get("/R").ports) names.push_back(port.name);
    EXPECT_EQ(names, (std::vector<std::string>{"in", "flow", "copied", "copied_old", "connected"}));
}

TEST_F(RttCompat, PortsAreFrozenAfterConfigureHook) {
    loadOld("TooLate", "L");
    EXPECT_EQ(errorOf([this] { start(); }),
              "/L (rtcf_unit_test/TooLate): start failed: it threw: port 'late' declared after "
              "configure()");
}

TEST_F(RttCompat, APortReplacesAnEarlierOneOfTheSameName) {
    loadOld("Third", "F", {{"out", "thirds"}});
    loadOld("Twice", "T", {{"in", "thirds"}});
    step(4);  // to iteration 3
    EXPECT_EQ(value("/T", "out"), 3.0);
    EXPECT_EQ(value("/T", "connected"), 10.0);
}

TEST_F(RttCompat, PortsOfOneNameAndDifferentTypesAreRejected) {
    EXPECT_EQ(errorOf([this] { loadOld("Retyped", "R"); }),
              "/R (rtcf_unit_test/Retyped): configure failed: it threw: port 'port' is added "
              "twice, with different types: rename one");
    EXPECT_EQ(errorOf([this] { loadOld("Renamed", "R"); }),
              "/R (rtcf_unit_test/Renamed): configure failed: it threw: port 'one' is added again "
              "as 'other': a port has one name");
}

TEST_F(RttCompat, ReadReturnsWhetherDataExistAndAreNew) {
    loadOld("Reader", "R", {{"in", "thirds"}});
    step(1);
    EXPECT_EQ(value("/R", "flow"), kNoData);
    EXPECT_EQ(value("/R", "copied"), -1.0);
    EXPECT_EQ(value("/R", "copied_old"), -1.0);
    EXPECT_EQ(value("/R", "connected"), 0.0);
    stop();
    loadOld("Third", "T", {{"out", "thirds"}});
    step(1);  // iteration 0
    EXPECT_EQ(value("/R", "flow"), kNewData);
    EXPECT_EQ(value("/R", "copied"), 0.0);
    EXPECT_EQ(value("/R", "connected"), 1.0);
    step(1);
    EXPECT_EQ(value("/R", "flow"), kOldData);
    EXPECT_EQ(value("/R", "copied"), -1.0);  // old data were not requested
    EXPECT_EQ(value("/R", "copied_old"), 0.0);
    step(2);
    EXPECT_EQ(value("/R", "flow"), kNewData);
    EXPECT_EQ(value("/R", "copied"), 3.0);
}

TEST_F(RttCompat, OutputKnowsWhetherItIsRead) {
    loadOld("Third", "T", {{"out", "thirds"}});
    step(1);
    EXPECT_EQ(value("/T", "heard"), 0.0);
    loadOld("Reader", "R", {{"in", "thirds"}});
    step(3);
    EXPECT_EQ(value("/T", "heard"), 1.0);
    unload("/R");
    step(3);
    EXPECT_EQ(value("/T", "heard"), 0.0);
    configure([](RunnerSettings& settings) { settings.whitelist = "/thirds"; });
    step(3);
    EXPECT_EQ(value("/T", "heard"), 1.0);  // read by a topic
}

TEST_F(RttCompat, StatesFollowTheHooks) {
    loadOld("Teller", "T");
    step(1);
    stop();
    unload("/T");
    std::vector<std::string> lines = said("/T");
    lines.erase(std::remove_if(lines.begin(), lines.end(),
                               [](const std::string& line) {
                                   return line.find(", state ") == std::string::npos;
                               }),
                lines.end());
    // PreOperational is 1, Stopped 4, Running 5.
    EXPECT_EQ(lines, (std::vector<std::string>{
                         "configure: not running, state 1, target 4",
                         "start: not running, state 4, target 5",
                         "update: running, state 5, target 5",
                         "stop: running, state 5, target 4",
                         "cleanup: not running, state 4, target 1",
                     }));
}

TEST_F(RttCompat, ComponentKnowsItsNameFromTheConstructorOn) {
    ComponentDefinition component = definition("Teller", "T");
    component.ns = "/arm";
    onGraphThread([&] {
        return runner().load(component, RTCF_UNIT_COMPONENTS "/old_style.so",
                             [](const std::string&) {});
    });
    EXPECT_TRUE(hasSaid("/arm/T", "constructed as T, is T"));
}

TEST_F(RttCompat, ComponentKnowsTheLoopsTime) {
    configure([](RunnerSettings& settings) {
        settings.frequency_hz = 500.0;
        settings.loop.period_ns = 2'000'000;
    });
    loadOld("Teller", "T");
    step(3);
    EXPECT_TRUE(hasSaid("/T", "period 0.002 s, 500 Hz, iteration 2, time 0.004000000"));
}

TEST_F(RttCompat, LogKeepsEachTextUnchanged) {
    loadOld("Writer", "W");
    step(1);
    const std::vector<std::string> lines = said("/W");
    const std::string long_text = std::string(1000, 'x') + "...";
    std::vector<std::string> expected{"100 % as it is: {} %d", "a std::string",
                                      "a number 0.333 ff 1", "arm has 7 joints of 0.50 m", "100 %"};
    // A text that needs several records, twice.
    for (int round = 0; round < 2; ++round) {
        for (std::size_t at = 0; at < long_text.size(); at += 318)
            expected.push_back(long_text.substr(at, 318));
    }
    expected.emplace_back("no braces are needed");
    EXPECT_EQ(lines, expected);
}

TEST_F(RttCompat, LogHasLevelAndSourceLineOfTheCall) {
    loadOld("Writer", "W");
    step(1);
    const std::vector<LogEntry> entries = logged();
    const auto found = std::find_if(entries.begin(), entries.end(), [](const LogEntry& entry) {
        return entry.message == "a std::string";
    });
    ASSERT_NE(found, entries.end());
    EXPECT_EQ(found->level, LogLevel::Warn);
    EXPECT_NE(found->file.find("old_style.cpp"), std::string::npos);
    EXPECT_EQ(found->function, "updateHook");
    EXPECT_TRUE(found->realtime);
}

TEST_F(RttCompat, MessagesThatFitTheSampleAreWritten) {
    loadOld("Grower", "G");
    step(400);
    EXPECT_EQ(iteration(), 400U);
}

TEST_F(RttCompat, ExtensionInAConstructorIsRejected) {
    EXPECT_EQ(errorOf([this] { loadOld("TooEarly", "E"); }),
              "/E (rtcf_unit_test/TooEarly): constructor failed: it threw: RtcfExtension does not "
              "work in a constructor: use it from configureHook() on, in a component that "
              "ORO_CREATE_COMPONENT registers");
}

TEST_F(RttCompat, NodeHandleWithoutANodeIsRejected) {
    const std::string why = errorOf([this] { loadOld("NeedsRos", "N"); });
    EXPECT_NE(why.find("configure failed"), std::string::npos) << why;
    EXPECT_NE(why.find("nodeHandle()"), std::string::npos) << why;
}

TEST_F(RttCompat, PortsCarryStructsEnumsArraysStringsAndVectors) {
    loadApi("Sender", "S",
            {{"gains", "g"}, {"mode", "m"}, {"triple", "t"}, {"text", "s"}, {"numbers", "n"}});
    loadApi("Receiver", "R",
            {{"gains", "g"}, {"mode", "m"}, {"triple", "t"}, {"text", "s"}, {"numbers", "n"}});
    step(300);
    EXPECT_TRUE(
        hasSaid("/R", "7 0.5 2 3 a text that is longer than what a string holds in itself 99"));
}

TEST_F(RttCompat, OwnTypesStayInTheRunnerWithANote) {
    configure([](RunnerSettings& settings) { settings.whitelist = ".*"; });
    const ChangeOutcome outcome = loadApi("Receiver", "R");
    EXPECT_NE(std::find(outcome.notes.begin(), outcome.notes.end(),
                        "/gains is not on ROS: there is no ROS message for its type "
                        "rtcf_unit_test::Gains"),
              outcome.notes.end());
}

TEST_F(RttCompat, LogsOfEachKindArriveIncludingConstructors) {
    loadApi("Logger", "L");
    step(1);
    EXPECT_EQ(said("/L"),
              (std::vector<std::string>{"constructed by 1", "constructed by 2", "constructed by 3",
                                        "configured", "updated", "and again"}));
}

TEST_F(RttCompat, LogOfAFailingConstructorArrives) {
    EXPECT_NE(errorOf([this] { loadApi("Unlucky", "U"); }).find("no luck"), std::string::npos);
    EXPECT_TRUE(hasSaid("/U", "about to fail"));
}

TEST_F(RttCompat, ErrorHookRunsInsteadOfUpdateHookUntilItRecovers) {
    loadApi("Erring", "E");
    step(5);
    EXPECT_EQ(said("/E"),
              (std::vector<std::string>{"update 0", "update 1", "error 2", "error 3", "update 4"}));
}

TEST_F(RttCompat, PortsCanBeFoundClearedDisconnectedAndCallBack) {
    loadOld("Third", "T", {{"out", "thirds"}});
    loadApi("Listener", "L", {{"in", "thirds"}});
    step(7);
    // Written in iterations 0, 3 and 6.
    EXPECT_EQ(said("/L"), (std::vector<std::string>{"in other yesyes", "called by in", "0: 2",
                                                    "1: 1", "2: 0", "called by in", "3: 2", "4: 1",
                                                    "sample 3", "5: 0", "6: 0", "sample -1"}));
}

// A constructor's properties are available to the loader, also through a service.
TEST_F(RttCompat, PropertiesAreParametersThatSetTheirVariables) {
    ComponentDefinition component = definition("Property21", "P");
    component.parameters = {{"gain", 1.5}, {"label", std::string("given")}};
    const auto load = [&] {
        return runner().load(component, RTCF_UNIT_COMPONENTS "/old_api.so",
                             [](const std::string&) {});
    };
    onGraphThread(load);
    EXPECT_TRUE(hasSaid("/P", "configured with 1.5 3 given"));
    EXPECT_FALSE(hasSaid("/P", "not shown"));
    step(1);
    EXPECT_EQ(value("/P", "gain_seen"), 1.5);
    step(2);
    EXPECT_EQ(value("/P", "gain_seen"), 7.0);  // the component's own value
    setParameters("/P", {{"gain", 2.0}, {"late", 0.25}, {"label", std::string("late")}});
    step(1);
    EXPECT_EQ(value("/P", "gain_seen"), 2.25);
    stop();
    EXPECT_TRUE(hasSaid("/P", "stopped with late"));
}

TEST_F(RttCompat, PropertiesAfterTheConstructorAreRejected) {
    EXPECT_EQ(errorOf([this] { loadApi("LateProperty", "L"); }),
              "/L (rtcf_unit_test/LateProperty): configure failed: it threw: property 'late' is "
              "added too late: add it in the constructor");
}

TEST_F(RttCompat, OperationsCompileAndAreReportedAsUnsupported) {
    loadApi("Property21", "P");
    EXPECT_TRUE(hasSaid("/P",
                        "operation 'reset' cannot be called in rtcf: offer a ROS service by "
                        "getNodeHandle() instead"));
}

TEST_F(RttCompat, TheLoopIsActiveOnlyInTheCycle) {
    loadApi("Property21", "P");
    step(1);
    stop();
    for (const char* line :
         {"configureHook: not active", "updateHook: active", "stopHook: not active"})
        EXPECT_TRUE(hasSaid("/P", line)) << line;
}

}  // namespace
}  // namespace rtcf::test
