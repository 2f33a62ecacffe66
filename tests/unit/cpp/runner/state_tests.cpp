// Declared state: kept by a replacement, shown, reset.
#include <gtest/gtest.h>

#include <algorithm>

#include "support/runner_fixture.hpp"

namespace rtcf::test {
namespace {

class DeclaredState : public RunnerFixture {
   protected:
    static std::string version(int number) {
        return RTCF_UNIT_COMPONENTS "/stateful_" + std::to_string(number) + ".so";
    }
    static ComponentDefinition stateful() { return definition("Stateful", "A"); }
    void loadVersion(int number) {
        onGraphThread(
            [&] { return runner().load(stateful(), version(number), [](const std::string&) {}); });
    }
    std::vector<std::string> replaceBy(int number) {
        return onGraphThread([&] {
                   return runner().replace("/A", stateful(), version(number), false,
                                           [](const std::string&) {});
               })
            .notes;
    }
    std::string state(const std::string& name) {
        const auto graph = runner().graph();
        const auto& declared = graph->get("/A").states;
        const auto values = onGraphThread([&] { return runner().states("/A"); });
        for (std::size_t i = 0; i < values.size(); ++i) {
            if (declared[i].name == name) return values[i];
        }
        return "none";
    }
    static bool has(const std::vector<std::string>& notes, const std::string& note) {
        return std::find(notes.begin(), notes.end(), note) != notes.end();
    }
};

TEST_F(DeclaredState, IsKeptByARebuiltComponentInARunningLoop) {
    loadVersion(1);
    start();
    ASSERT_TRUE(runs());
    const auto notes = replaceBy(2);
    ASSERT_TRUE(runs());
    stop();
    EXPECT_EQ(value("/A", "out"), static_cast<double>(iteration()))
        << "exactly one update per cycle, in one counter";
    EXPECT_EQ(value("/A", "skipped"), 0.0);
    EXPECT_EQ(state("new_name"), "7.5") << "handed over by takeOver()";
    EXPECT_NE(state("fresh"), "0.25") << "the output's last value, by takeOver()";
    EXPECT_EQ(state("gain"), "2") << "of another type than before";
    for (const char* note : {"state gain of /A begins at 2: it was float and is double",
                             "gone from /A: states old_name, dropped"})
        EXPECT_TRUE(has(notes, note)) << note;
    EXPECT_EQ(notes.size(), 3U) << "and one line on the new states";
}

TEST_F(DeclaredState, IsKeptUnchangedWithoutNotes) {
    loadVersion(1);
    step(10);
    EXPECT_TRUE(replaceBy(1).empty());
    step(5);
    EXPECT_EQ(value("/A", "out"), 15.0);
    EXPECT_EQ(state("delay"), "{now: 14, before: 13}");
}

TEST_F(DeclaredState, MissingInTheOldComponentIsReported) {
    load(definition("Camera", "B"));
    const auto notes = onGraphThread([&] {
                           return runner().replace("/B", definition("Recorder", "B"),
                                                   RTCF_UNIT_COMPONENTS "/rtcf_unit_test.so", false,
                                                   [](const std::string&) {});
                       }).notes;
    EXPECT_EQ(notes,
              std::vector<std::string>{
                  "/B begins at its initial state: the replaced component declares no state"});
}

TEST_F(DeclaredState, IsShownWithItsDeclaration) {
    loadVersion(1);
    step(3);
    const auto graph = runner().graph();
    const auto& states = graph->get("/A").states;
    ASSERT_EQ(states.size(), 5U);
    EXPECT_EQ(states[3].name, "count");
    EXPECT_EQ(states[3].type, "uint64");
    EXPECT_EQ(states[3].doc, "updates so far");
    EXPECT_EQ(states[3].initial, "0");
    EXPECT_EQ(states[4].type, "{now: double, before: double}");
    EXPECT_EQ(states[4].unit, "cycles");
    EXPECT_EQ(state("count"), "3");
    EXPECT_EQ(state("dropped"), "1");
}

TEST_F(DeclaredState, IsResetAtABoundaryOfARunningLoop) {
    loadVersion(1);
    start();
    ASSERT_TRUE(runs());
    onGraphThread([&] { return runner().reset("/A"); });
    ASSERT_TRUE(runs());
    stop();
    EXPECT_LT(value("/A", "out"), static_cast<double>(iteration()));
    EXPECT_GT(value("/A", "out"), 0.0);
}

TEST_F(DeclaredState, WithoutDeclarationCannotBeReset) {
    load(definition("Camera", "B"));
    EXPECT_EQ(errorOf([&] { onGraphThread([&] { return runner().reset("/B"); }); }),
              "/B declares no state (rtcf::State) to reset");
    EXPECT_NE(errorOf([&] { onGraphThread([&] { return runner().reset("/C"); }); }), "");
}

TEST_F(DeclaredState, IsSetExactlyOrNotAtAll) {
    loadVersion(1);
    step(3);
    const auto set = [&](const std::string& name, const ParameterValue& value) {
        return errorOf([&] {
            onGraphThread(
                [&] { return runner().setStates("/A", {{"old_name", 1.25}, {name, value}}); });
        });
    };
    EXPECT_EQ(set("count", std::int64_t{41}), "");
    EXPECT_EQ(state("count"), "41");
    EXPECT_EQ(state("old_name"), "1.25");
    EXPECT_EQ(set("dropped", false), "");
    EXPECT_EQ(state("dropped"), "0");
    EXPECT_EQ(set("gain", std::int64_t{2}), "");
    EXPECT_EQ(state("gain"), "2");
    onGraphThread([&] { return runner().setStates("/A", {{"old_name", 9.0}}); });
    EXPECT_NE(set("count", std::int64_t{-1}).find("type uint64"), std::string::npos);
    EXPECT_NE(set("count", 1.5).find("type uint64"), std::string::npos);
    EXPECT_NE(set("dropped", std::int64_t{1}).find("type bool"), std::string::npos);
    EXPECT_NE(set("delay", 1.0).find("only numbers and bools"), std::string::npos);
    EXPECT_NE(set("none", 1.0).find("declares no state none"), std::string::npos);
    EXPECT_EQ(state("old_name"), "9") << "all of a batch, or nothing";
    step(1);
    EXPECT_EQ(value("/A", "out"), 42.0);
    start();
    EXPECT_NE(set("gain", 1.0).find("stop it to set state"), std::string::npos);
}

// A graph file with a rebuilt library also replaces components.
TEST_F(DeclaredState, IsKeptByApply) {
    loadVersion(1);
    step(10);
    const auto outcome = onGraphThread([&] {
        return runner().apply({{stateful(), version(2)}}, false, [](const std::string&) {});
    });
    EXPECT_TRUE(has(outcome.notes, "gone from /A: states old_name, dropped"));
    step(1);
    EXPECT_EQ(value("/A", "out"), 11.0);
}

}  // namespace
}  // namespace rtcf::test
