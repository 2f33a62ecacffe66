// The order of the hooks; stop never waits for a hook.
#include <gtest/gtest.h>

#include <algorithm>

#include "support/runner_fixture.hpp"

namespace rtcf::test {
namespace {

class Lifecycle : public RunnerFixture {
   protected:
    // A Recorder that reads `in` and writes `out`.
    static ComponentDefinition recorder(const std::string& name, const std::string& in,
                                        const std::string& out) {
        ComponentDefinition result = definition("Recorder", name);
        result.remaps = {{"in", in}, {"out", out}};
        return result;
    }

    static ComponentDefinition blocker(const std::string& name, const std::string& hook) {
        ComponentDefinition result = definition("Blocker", name);
        result.remaps = {{"in", name + "_in"}, {"out", name + "_out"}};
        result.parameters = {{"blocks", hook}};
        return result;
    }

    // The notes of one hook.
    std::vector<std::string> notesOf(const std::string& hook) {
        std::vector<std::string> result;
        for (const std::string& note : journal().notes()) {
            const std::string suffix = " " + hook;
            if (note.size() > suffix.size() &&
                note.compare(note.size() - suffix.size(), suffix.size(), suffix) == 0) {
                result.push_back(note.substr(0, note.size() - suffix.size()));
            }
        }
        return result;
    }

    // The schedule is /C, /B, /A.
    void loadChain() {
        load(recorder("A", "b", "a"));
        load(recorder("B", "c", "b"));
        load(recorder("C", "none", "c"));
    }
};

TEST_F(Lifecycle, HooksKeepTheirOrder) {
    load(definition("Recorder", "A"));
    start();
    ASSERT_TRUE(runs());
    stop();
    endRunner();
    EXPECT_EQ(journal().notes(), (std::vector<std::string>{"/A configure", "/A start", "/A update",
                                                           "/A safe", "/A stop", "/A cleanup"}));
}

TEST_F(Lifecycle, ComponentCanBeStartedAgain) {
    load(definition("Recorder", "A"));
    for (int i = 0; i < 3; ++i) {
        start();
        ASSERT_TRUE(runs());
        stop();
        EXPECT_EQ(state(), RunnerState::Stopped);
    }
    EXPECT_EQ(journal().count("/A configure"), 1U);
    EXPECT_EQ(journal().count("/A start"), 3U);
    EXPECT_EQ(journal().count("/A stop"), 3U);
    EXPECT_EQ(journal().count("/A safe"), 3U);
}

TEST_F(Lifecycle, StartAndSafeFollowTheScheduleAndStopReversesIt) {
    loadChain();
    EXPECT_EQ(order(), (std::vector<std::string>{"/C", "/B", "/A"}));
    start();
    ASSERT_TRUE(runs());
    stop();
    EXPECT_EQ(notesOf("start"), (std::vector<std::string>{"/C", "/B", "/A"}));
    EXPECT_EQ(notesOf("safe"), (std::vector<std::string>{"/C", "/B", "/A"}));
    EXPECT_EQ(notesOf("stop"), (std::vector<std::string>{"/A", "/B", "/C"}));
}

TEST_F(Lifecycle, FailedStartStopsTheStartedComponents) {
    loadChain();
    setParameters("/A", {{"refuses", std::string("start")}});
    const std::string text = errorOf([this] { start(); });
    EXPECT_NE(text.find("/A (rtcf_unit_test/Recorder): start failed: set to refuse start"),
              std::string::npos)
        << text;
    EXPECT_EQ(state(), RunnerState::Stopped);
    EXPECT_EQ(notesOf("stop"), (std::vector<std::string>{"/B", "/C"}));
    setParameters("/A", {{"refuses", std::string()}});
    start();
    EXPECT_TRUE(runs());
}

TEST_F(Lifecycle, StartOfARunningLoopChangesNothing) {
    load(definition("Recorder", "A"));
    start();
    ASSERT_TRUE(runs());
    start();
    EXPECT_EQ(journal().count("/A start"), 1U);
    EXPECT_TRUE(runs());
}

TEST_F(Lifecycle, EmptyGraphRunsToo) {
    start();
    EXPECT_TRUE(runs());
    stop();
    EXPECT_EQ(state(), RunnerState::Stopped);
}

TEST_F(Lifecycle, EndOfTheRunnerStopsARunningLoopInOrder) {
    loadChain();
    start();
    ASSERT_TRUE(runs());
    endRunner();
    EXPECT_EQ(notesOf("safe").size(), 3U);
    EXPECT_EQ(notesOf("stop"), (std::vector<std::string>{"/A", "/B", "/C"}));
    EXPECT_EQ(notesOf("cleanup").size(), 3U);
}

TEST_F(Lifecycle, QueriesAreAnsweredWhileAHookBlocks) {
    load(definition("Recorder", "A"));
    journal().gate_open = false;
    const ComponentDefinition late = blocker("B", "configure");
    auto loading = beginLoad(late);
    ASSERT_TRUE(eventually([this] { return journal().count("/B configure") == 1; }));
    EXPECT_EQ(order(), std::vector<std::string>{"/A"});
    EXPECT_EQ(state(), RunnerState::Stopped);
    EXPECT_EQ(runner().recorder().runningHook().name(), "/B.configure");
    journal().gate_open = true;
    loading.get();
    EXPECT_EQ(order(), (std::vector<std::string>{"/A", "/B"}));
}

TEST_F(Lifecycle, LoopStopsWhileAHookBlocksAndTheNewComponentIsNotStarted) {
    load(definition("Recorder", "A"));
    start();
    ASSERT_TRUE(runs());
    journal().gate_open = false;
    const ComponentDefinition late = blocker("B", "configure");
    auto loading = beginLoad(late);
    ASSERT_TRUE(eventually([this] { return journal().count("/B configure") == 1; }));
    ASSERT_TRUE(runs()) << "the loop does not wait for the hook";
    runner().requestStop();
    ASSERT_TRUE(eventually([this] { return !runner().loop().running(); }));
    EXPECT_EQ(journal().count("/A safe"), 1U);
    EXPECT_EQ(journal().count("/A stop"), 0U) << "hooks follow when the graph thread is free";
    journal().gate_open = true;
    loading.get();
    ASSERT_TRUE(eventually([this] { return state() == RunnerState::Stopped; }));
    EXPECT_EQ(journal().count("/A stop"), 1U);
    EXPECT_EQ(journal().count("/B start"), 0U);
    start();
    ASSERT_TRUE(runs());
    EXPECT_EQ(journal().count("/B start"), 1U);
}

TEST_F(Lifecycle, LoopEndsWhileAnArrivingComponentStarts) {
    load(definition("Recorder", "A"));
    start();
    ASSERT_TRUE(runs());
    journal().gate_open = false;
    const ComponentDefinition late = blocker("B", "start");
    auto loading = beginLoad(late);
    ASSERT_TRUE(eventually([this] { return journal().count("/B start") == 1; }));
    runner().requestStop();
    ASSERT_TRUE(eventually([this] { return !runner().loop().running(); }));
    journal().gate_open = true;
    loading.get();
    ASSERT_TRUE(eventually([this] { return state() == RunnerState::Stopped; }));
    EXPECT_EQ(journal().count("/A stop"), 1U);
    EXPECT_EQ(journal().count("/B stop"), 1U);
    EXPECT_EQ(journal().count("/B update"), 0U);
}

TEST_F(Lifecycle, StopWhileStartHooksRunIsFinal) {
    load(definition("Recorder", "A"));
    const ComponentDefinition slow = blocker("B", "start");
    load(slow);
    journal().gate_open = false;
    auto starting = begin([this] { return runner().start([](const std::string&) {}); });
    ASSERT_TRUE(eventually([this] { return journal().count("/B start") == 1; }));
    runner().requestStop();
    journal().gate_open = true;
    const std::string text = errorOf([&] { starting.get(); });
    EXPECT_NE(text.find("a stop was requested after the start"), std::string::npos) << text;
    EXPECT_EQ(state(), RunnerState::Stopped);
    EXPECT_EQ(journal().count("/A update"), 0U);
    EXPECT_EQ(journal().count("/A stop"), 1U);
    EXPECT_EQ(journal().count("/B stop"), 1U);
    start();
    EXPECT_TRUE(runs()) << "a later start runs the loop";
}

TEST_F(Lifecycle, StopCancelsQueuedStartsAndSteps) {
    load(definition("Recorder", "A"));
    journal().gate_open = false;
    const ComponentDefinition slow = blocker("B", "configure");
    auto loading = beginLoad(slow);
    auto starting = begin([this] { return runner().start([](const std::string&) {}); });
    auto stepping = begin([this] { return runner().step(5, [](const std::string&) {}); });
    runner().requestStop();
    auto stopping = begin([this] { return runner().stop([](const std::string&) {}); });
    auto last = begin([this] { return runner().start([](const std::string&) {}); });
    journal().gate_open = true;
    loading.get();
    EXPECT_NE(errorOf([&] { starting.get(); }), "");
    EXPECT_NE(errorOf([&] { stepping.get(); }), "");
    stopping.get();
    EXPECT_EQ(journal().count("/A safe"), 0U) << "no cycle had run";
    last.get();
    EXPECT_TRUE(runs());
}

TEST_F(Lifecycle, LogRecordsOfHooksHaveTheComponentsName) {
    load(definition("Chatter", "A"));
    start();
    ASSERT_TRUE(runs());
    stop();
    unload("/A");
    std::vector<std::string> kinds;
    for (const LogEntry& entry : logged()) {
        EXPECT_EQ(entry.component, "/A");
        const std::string kind = entry.message.substr(0, entry.message.find(' '));
        if (kinds.empty() || kinds.back() != kind) kinds.push_back(kind);
    }
    // The loop's ring is emptied separately from the other one, so the order of these two records
    // is undefined.
    std::sort(kinds.begin(), kinds.end());
    EXPECT_EQ(kinds, (std::vector<std::string>{"cleanup", "configure", "safe", "start", "stop",
                                               "update"}));
}

TEST_F(Lifecycle, LogRecordsOfARejectedComponentAreNotLost) {
    ComponentDefinition chatter = definition("Chatter", "A");
    chatter.parameters = {{"refuses", true}};
    EXPECT_NE(errorOf([&] { load(chatter); }), "");
    std::vector<std::string> messages;
    for (const LogEntry& entry : logged()) {
        EXPECT_EQ(entry.component, "/A");
        messages.push_back(entry.message.substr(0, entry.message.find(' ')));
    }
    EXPECT_EQ(messages, (std::vector<std::string>{"configure", "cleanup"}));
}

TEST_F(Lifecycle, LogRecordsAtTheEndOfTheRunnerAreNotLost) {
    load(definition("Chatter", "A"));
    endRunner();
    const std::vector<LogEntry> entries = logged();
    ASSERT_FALSE(entries.empty());
    EXPECT_EQ(entries.back().message, "cleanup");
    EXPECT_EQ(entries.back().component, "/A");
}

}  // namespace
}  // namespace rtcf::test
