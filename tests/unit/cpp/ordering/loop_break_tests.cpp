// A loop break always reads the value of the previous cycle, at any position of its
// writer in the order.
#include <gtest/gtest.h>

#include "support/runner_fixture.hpp"

namespace rtcf::test {
namespace {

constexpr double kNone = 0.0;
constexpr double kOld = 1.0;
constexpr double kNew = 2.0;

class LoopBreak : public RunnerFixture {
   protected:
    // A Relay that adds nothing and reads `topic`; `broken` makes that connection a loop break.
    void loadReader(const std::string& name, const std::string& topic, bool broken) {
        ComponentDefinition reader = definition("Relay", name);
        reader.remaps = {{"in", topic}, {"out", name + "_out"}, {"status", name + "_status"}};
        reader.parameters = {{"add", 0.0}};
        if (broken) reader.breaks.ports = {"in"};
        load(reader);
    }

    // Writes its iteration to `topic` in each `every`-th cycle.
    void loadTicker(const std::string& name, const std::string& topic, std::int64_t every) {
        ComponentDefinition ticker = definition("Ticker", name);
        ticker.remaps = {{"out", topic}};
        ticker.parameters = {{"every", every}};
        load(ticker);
    }
};

TEST_F(LoopBreak, ReaderBeforeItsWriterSeesThePreviousCycle) {
    loadTicker("W", "x", 1);
    loadReader("A", "x", true);
    EXPECT_EQ(order(), (std::vector<std::string>{"/A", "/W"}));
    step(1);
    EXPECT_EQ(value("/A", "status"), kNone);
    step(9);
    EXPECT_EQ(value("/W", "out"), 9.0);
    EXPECT_EQ(value("/A", "out"), 8.0);
    EXPECT_EQ(value("/A", "status"), kNew);
}

TEST_F(LoopBreak, ReaderAfterItsWriterSeesThePreviousCycleToo) {
    loadTicker("W", "x", 1);
    loadReader("Z", "x", true);
    EXPECT_EQ(order(), (std::vector<std::string>{"/W", "/Z"}));
    step(1);
    EXPECT_EQ(value("/Z", "status"), kNone) << "values of this cycle are not read";
    step(9);
    EXPECT_EQ(value("/W", "out"), 9.0);
    EXPECT_EQ(value("/Z", "out"), 8.0);
    EXPECT_EQ(value("/Z", "status"), kNew);
}

TEST_F(LoopBreak, ReaderWithoutBreakSeesThisCycle) {
    loadTicker("W", "x", 1);
    loadReader("A", "x", false);
    EXPECT_EQ(order(), (std::vector<std::string>{"/W", "/A"}));
    step(10);
    EXPECT_EQ(value("/A", "out"), 9.0);
}

TEST_F(LoopBreak, BrokenAndOtherReadersOfOneWriterDoNotMix) {
    loadTicker("W", "x", 1);
    loadReader("Y", "x", false);
    loadReader("Z", "x", true);
    step(10);
    EXPECT_EQ(value("/Y", "out"), 9.0);
    EXPECT_EQ(value("/Z", "out"), 8.0);
}

TEST_F(LoopBreak, ValueIsNewOnceEvenIfTheWriterPauses) {
    loadTicker("W", "x", 4);
    loadReader("Z", "x", true);
    step(9);  // written in cycles 0, 4 and 8
    EXPECT_EQ(value("/Z", "out"), 4.0);
    EXPECT_EQ(value("/Z", "status"), kOld);
    step(1);
    EXPECT_EQ(value("/Z", "out"), 8.0);
    EXPECT_EQ(value("/Z", "status"), kNew);
    step(1);
    EXPECT_EQ(value("/Z", "status"), kOld);
}

TEST_F(LoopBreak, ComponentThatReadsItselfCounts) {
    ComponentDefinition self = definition("Relay", "S");
    self.remaps = {{"in", "x"}, {"out", "x"}};
    self.breaks.ports = {"in"};
    load(self);
    step(1);
    EXPECT_EQ(value("/S", "status"), kNone);
    EXPECT_EQ(value("/S", "out"), 1.0);
    step(99);
    EXPECT_EQ(value("/S", "out"), 100.0);
    EXPECT_EQ(value("/S", "status"), kNew);
}

TEST_F(LoopBreak, SettingDelaysByOneCycleAndRemovingCatchesUp) {
    loadTicker("W", "x", 1);
    loadReader("Z", "x", false);
    step(10);
    EXPECT_EQ(value("/Z", "out"), 9.0);
    setBreak("/Z", "in", true);
    step(1);
    EXPECT_EQ(value("/W", "out"), 10.0);
    EXPECT_EQ(value("/Z", "out"), 9.0);
    EXPECT_EQ(value("/Z", "status"), kOld) << "the value was read before";
    step(1);
    EXPECT_EQ(value("/Z", "out"), 10.0);
    EXPECT_EQ(value("/Z", "status"), kNew);
    setBreak("/Z", "in", false);
    step(1);
    EXPECT_EQ(value("/Z", "out"), 12.0);
}

TEST_F(LoopBreak, LastValueOfAnUnloadedWriterIsRead) {
    loadTicker("W", "x", 1);
    loadReader("A", "x", true);
    loadReader("Z", "x", false);
    step(10);
    unload("/W");
    step(2);
    EXPECT_EQ(value("/Z", "out"), 9.0);
    EXPECT_EQ(value("/Z", "status"), kOld);
    EXPECT_EQ(value("/A", "out"), 9.0) << "written after the reader ran, so read in the next cycle";
}

TEST_F(LoopBreak, ValueOfAnUnloadedWriterStaysUntilTheNextOneWrites) {
    loadTicker("W", "x", 1);
    loadReader("Z", "x", false);
    step(10);
    unload("/W");
    loadTicker("V", "x", 100);
    step(2);
    EXPECT_EQ(value("/Z", "out"), 9.0);
    EXPECT_EQ(value("/Z", "status"), kOld);
    setBreak("/Z", "in", true);
    step(2);
    EXPECT_EQ(value("/Z", "out"), 9.0) << "also through a copy";
    setBreak("/Z", "in", false);
    step(87);  // V has written in iteration 100
    EXPECT_EQ(value("/Z", "out"), 100.0);
}

}  // namespace
}  // namespace rtcf::test
