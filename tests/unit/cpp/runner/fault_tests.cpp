// Components that fail in update(), and loops that end by themselves.
#include <gtest/gtest.h>

#include <algorithm>

#include "common/utf8.hpp"
#include "support/runner_fixture.hpp"

namespace rtcf::test {
namespace {

class Fault : public RunnerFixture {
   protected:
    static ComponentDefinition recorder(const std::string& name, std::int64_t throws_at) {
        ComponentDefinition result = definition("Recorder", name);
        result.remaps = {{"in", name + "_in"}, {"out", name + "_out"}};
        result.parameters = {{"throws_at", throws_at}};
        return result;
    }

    std::vector<RunnerEvent> ends() const {
        std::vector<RunnerEvent> result;
        for (const RunnerEvent& event : events()) {
            if (event.kind == RunnerEvent::Kind::LoopEnded) result.push_back(event);
        }
        return result;
    }

    static ComponentDefinition wordless(const std::string& where) {
        ComponentDefinition result = definition("Wordless", "W");
        result.parameters = {{"where", where}};
        return result;
    }

    bool waitForFault() {
        return eventually([this] { return state() == RunnerState::Faulted; });
    }
};

TEST_F(Fault, ExceptionStopsTheLoopAndIsReported) {
    load(recorder("A", -1));
    load(recorder("B", 10));
    load(recorder("C", -1));
    start();
    ASSERT_TRUE(waitForFault());
    ASSERT_EQ(ends().size(), 1U);
    const RunnerEvent event = ends()[0];
    EXPECT_EQ(event.component, "/B");
    EXPECT_EQ(event.iteration, 10U);
    for (const char* part : {"iteration 10", "/B", "update()", "threw", "as told"}) {
        EXPECT_NE(event.message.find(part), std::string::npos) << event.message;
    }
    EXPECT_EQ(event.message.find('\n'), std::string::npos);
    EXPECT_NE(runner().graph()->get("/B").fault.find("as told"), std::string::npos);
    EXPECT_EQ(runner().graph()->get("/A").fault, "");
    EXPECT_EQ(value("/A", "out"), 11.0);
    EXPECT_EQ(value("/C", "out"), 10.0) << "the cycle was abandoned before it";
}

TEST_F(Fault, AnExceptionWithoutATextIsReported) {
    EXPECT_NE(errorOf([&] {
                  load(wordless("configure"));
              }).find("configure failed: it threw: an exception without a text"),
              std::string::npos);
    load(wordless("update"));
    start();
    ASSERT_TRUE(waitForFault());
    EXPECT_NE(ends().at(0).message.find("an exception without a text"), std::string::npos);
    setParameters("/W", {{"where", std::string("cleanup")}});
    unload("/W");
    EXPECT_NE(logged().back().message.find("an exception without a text"), std::string::npos);
    EXPECT_NE(errorOf([&] {
                  load(definition("ThrowsANumber", "N"));
              }).find("it threw an exception of unknown type"),
              std::string::npos);
}

TEST_F(Fault, ANullTextIsReported) {
    EXPECT_NE(errorOf([&] { load(wordless("fail")); }).find("no device (null)"), std::string::npos);
    load(wordless("log"));
    start();
    ASSERT_TRUE(runs());
    EXPECT_EQ(logged().back().message, "host (null)");
    setParameters("/W", {{"where", std::string("fault")}});
    EXPECT_TRUE(eventually([&] {
        return runner().graph()->get("/W").fault.find("a fault without a text") !=
               std::string::npos;
    }));
}

TEST_F(Fault, AHookWithoutATextIsNotReportedWithThatOfAnEarlierOne) {
    load(wordless(""));
    EXPECT_NE(errorOf([&] {
                  setParameters("/W", {{"where", std::string("prepare")}});
              }).find("an earlier text"),
              std::string::npos);
    setParameters("/W", {{"where", std::string("start")}});
    EXPECT_NE(errorOf([&] { start(); }).find("it returned false without an error text"),
              std::string::npos);
}

TEST_F(Fault, AComponentThatLosesAMemberIsNotLoaded) {
    const std::string dropped = errorOf([&] { load(definition("LosesAMember", "L")); });
    EXPECT_NE(
        dropped.find("/L (rtcf_unit_test/LosesAMember): input 'in' ended before the component"),
        std::string::npos)
        << dropped;
    ComponentDefinition local = definition("LosesAMember", "L");
    local.parameters = {{"local", true}};
    const std::string declared = errorOf([&] { load(local); });
    EXPECT_NE(declared.find("parameter 'gain' declared after the constructor"), std::string::npos)
        << declared;
    load(recorder("A", -1));
    start();
    EXPECT_TRUE(runs());
    EXPECT_EQ(order(), std::vector<std::string>{"/A"});
}

TEST_F(Fault, SafeIsCalledForAllInOrder) {
    load(recorder("A", -1));
    load(recorder("B", 10));
    load(recorder("C", -1));
    start();
    ASSERT_TRUE(waitForFault());
    EXPECT_EQ(journal().count("/A safe"), 1U);
    EXPECT_EQ(journal().count("/B safe"), 1U);
    EXPECT_EQ(journal().count("/C safe"), 1U);
    for (const char* note : {"/A stop", "/B stop", "/C stop"})
        EXPECT_EQ(journal().count(note), 1U) << note;
    const auto notes = journal().notes();
    EXPECT_LT(std::find(notes.begin(), notes.end(), "/A safe"),
              std::find(notes.begin(), notes.end(), "/C safe"));
}

TEST_F(Fault, LoopStartsAgainOnceTheCauseIsGone) {
    load(recorder("B", 10));
    start();
    ASSERT_TRUE(waitForFault());
    setParameters("/B", {{"throws_at", std::int64_t{-1}}});
    start();
    EXPECT_EQ(state(), RunnerState::Running);
    EXPECT_EQ(runner().graph()->get("/B").fault, "");
    EXPECT_EQ(runner().status().loop_fault, "");
    EXPECT_TRUE(runs());
}

TEST_F(Fault, GraphCanBeChangedAfterIt) {
    load(recorder("B", 10));
    start();
    ASSERT_TRUE(waitForFault());
    unload("/B");
    load(recorder("C", -1));
    EXPECT_EQ(journal().count("/C start"), 0U);
    start();
    EXPECT_TRUE(runs());
}

// The loop ends while the graph thread is busy; then the culprit is unloaded immediately.
TEST_F(Fault, CulpritUnloadedImmediatelyIsStillNamed) {
    load(recorder("B", 10));
    start();
    onGraphThread([this] {
        EXPECT_TRUE(eventually([this] { return !runner().loop().running(); }));
        return runner().unload({"/B"}, [](const std::string&) {});
    });
    EXPECT_EQ(state(), RunnerState::Faulted);
    ASSERT_EQ(ends().size(), 1U);
    EXPECT_EQ(ends()[0].component, "/B");
    EXPECT_EQ(journal().count("/B stop"), 1U);
    EXPECT_EQ(journal().count("/B cleanup"), 1U);
}

TEST_F(Fault, ComponentLoadedRightAfterItIsNotStarted) {
    load(recorder("B", 10));
    start();
    const ComponentDefinition late = recorder("C", -1);
    onGraphThread([&] {
        EXPECT_TRUE(eventually([this] { return !runner().loop().running(); }));
        return runner().load(late, RTCF_UNIT_COMPONENTS "/rtcf_unit_test.so",
                             [](const std::string&) {});
    });
    EXPECT_EQ(state(), RunnerState::Faulted);
    EXPECT_EQ(ends().size(), 1U);
    EXPECT_EQ(journal().count("/B stop"), 1U);
    EXPECT_EQ(journal().count("/C start"), 0U);
}

TEST_F(Fault, StartRightAfterItRestartsAll) {
    load(recorder("A", -1));
    load(recorder("B", 10));
    start();
    onGraphThread([this] {
        EXPECT_TRUE(eventually([this] { return !runner().loop().running(); }));
        runner().setParameters("/B", {{"throws_at", std::int64_t{-1}}});
        return runner().start([](const std::string&) {});
    });
    EXPECT_EQ(state(), RunnerState::Running);
    EXPECT_TRUE(runs());
    EXPECT_EQ(ends().size(), 1U);
    EXPECT_EQ(journal().count("/A start"), 2U);
    EXPECT_EQ(journal().count("/A stop"), 1U);
}

TEST_F(Fault, StopOfAFaultedRunnerIsSilent) {
    load(recorder("B", 10));
    start();
    ASSERT_TRUE(waitForFault());
    EXPECT_NO_THROW(stop());
    EXPECT_EQ(journal().count("/B stop"), 1U);
}

// A component that faults in every cycle has a separate queue entry.
TEST_F(Fault, NoFaultIsLostInAFloodOfOthers) {
    for (const std::string name : {"N1", "N2"}) {
        ComponentDefinition flooding = definition("Controller", name);
        flooding.parameters = {{"nan_from", std::int64_t{0}}};
        for (const std::string port : {"effort", "other", "checked"})
            flooding.remaps.emplace_back(port, name + "_" + port);
        load(flooding);
    }
    ComponentDefinition late = recorder("Z", 300);
    late.optional = true;
    load(late);
    // No reports are taken while the graph thread is busy.
    onGraphThread([this] {
        runner().start([](const std::string&) {});
        return eventually([this] { return iteration() > 400; });
    });
    const auto told = [this](const std::string& part) {
        const auto all = events();
        return std::count_if(all.begin(), all.end(), [&](const RunnerEvent& event) {
            return event.message.find(part) != std::string::npos;
        });
    };
    EXPECT_TRUE(eventually([&] { return told("/Z: iteration 300: update() threw") == 1; }));
    EXPECT_EQ(told("/N1: iteration 0: output checked is not finite"), 1);
    EXPECT_EQ(told("/N2: iteration 0: output checked is not finite"), 1);
    EXPECT_GE(runner().graph()->get("/N1").statistics->faults.count.value(), 400U);
    EXPECT_EQ(state(), RunnerState::Running);
}

TEST_F(Fault, OfAnEarlierRunAreNotCounted) {
    ComponentDefinition flooding = definition("Controller", "N");
    flooding.parameters = {{"nan_from", std::int64_t{0}}};
    load(flooding);
    const auto told = [this] {
        std::vector<std::string> found;
        for (const RunnerEvent& event : events()) {
            if (event.message.find("is not finite") != std::string::npos)
                found.push_back(event.message);
        }
        return found;
    };
    start();
    ASSERT_TRUE(eventually([&] { return told().size() == 1; }));
    stop();
    // More faults than in the first run, before the graph thread takes the first report.
    onGraphThread([this] {
        runner().start([](const std::string&) {});
        return eventually([this] { return iteration() > 400; });
    });
    ASSERT_TRUE(eventually([&] { return told().size() == 2; }));
    EXPECT_EQ(told()[1].find("since the last report"), std::string::npos) << told()[1];
}

TEST_F(Fault, LongExceptionTextIsCut) {
    // Recorder's text is short; the culprit's name makes the message long.
    const std::string name = "B" + std::string(230, 'b');
    load(recorder(name, 3));
    start();
    ASSERT_TRUE(waitForFault());
    ASSERT_EQ(ends().size(), 1U);
    EXPECT_NE(ends()[0].message.find("as told"), std::string::npos);
}

TEST_F(Fault, CutTextEndsWithAWholeCharacter) {
    std::string text;
    for (int i = 0; i < 300; ++i) text += "\u00E4";  // 2 bytes; the arrays hold an odd number
    ComponentDefinition optional = recorder("A", 3);
    optional.optional = true;
    optional.parameters.emplace_back("text", text);
    load(optional);
    ComponentDefinition culprit = recorder("B", 6);
    culprit.parameters.emplace_back("text", text);
    load(culprit);
    start();
    ASSERT_TRUE(waitForFault());
    std::vector<std::string> messages;
    EXPECT_TRUE(eventually([&] {
        messages.clear();
        for (const RunnerEvent& event : events()) {
            if (event.message.find("\u00E4\u00E4") != std::string::npos)
                messages.push_back(event.message);
        }
        return messages.size() == 2;
    }));
    for (const std::string& message : messages) EXPECT_TRUE(executor::isUtf8(message)) << message;
    EXPECT_TRUE(executor::isUtf8(runner().graph()->get("/B").fault));
}

TEST_F(Fault, StatesAreNumbered) {
    load(definition("Recorder", "A"));
    const auto number = [this] { return runner().numberedState().number; };
    EXPECT_EQ(number(), 0U);
    start();
    EXPECT_EQ(number(), 1U);
    EXPECT_EQ(runner().numberedState().state, RunnerState::Running);
    setParameters("/A", {{"gain", 2.0}});
    EXPECT_EQ(number(), 1U);
    stop();
    EXPECT_EQ(number(), 2U);
    unload("/A");
    load(recorder("B", 1));
    step(1);
    EXPECT_EQ(number(), 3U);
    step(1);
    EXPECT_EQ(number(), 4U);
    ASSERT_EQ(ends().size(), 1U);
    EXPECT_EQ(ends()[0].state.number, 4U) << "an event has the number of its state";
    EXPECT_EQ(ends()[0].state.state, RunnerState::Faulted);
}

}  // namespace
}  // namespace rtcf::test
