// Queues in a graph: each message of components and from outside arrives, in order. Stepped, so
// that each cycle is known.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "support/runner_fixture.hpp"

namespace rtcf::test {
namespace {

class Queues : public RunnerFixture {
   protected:
    static ComponentDefinition collector(const std::string& in) {
        ComponentDefinition result = definition("Collector", "C");
        result.remaps = {{"in", in}};
        return result;
    }
    void send(double number) {
        std::array<std::uint8_t, sizeof number> bytes{};
        std::memcpy(bytes.data(), &number, sizeof number);
        ASSERT_TRUE(bridge().injector("/commands")->deliver(bytes.data(), sizeof number));
    }
    void sendText(const std::string& text) {
        std::vector<std::uint8_t> bytes(4 + text.size());
        const auto size = static_cast<std::uint32_t>(text.size());
        std::memcpy(bytes.data(), &size, sizeof size);
        std::memcpy(bytes.data() + 4, text.data(), text.size());
        ASSERT_TRUE(bridge().injector("/texts")->deliver(bytes.data(),
                                                         static_cast<std::uint32_t>(bytes.size())));
    }
    void loadOutside() {
        configure([](RunnerSettings& settings) { settings.whitelist = "/commands|/texts"; });
        load(collector("commands"));
    }
};

TEST_F(Queues, MessagesFromOutsideArriveInOrder) {
    loadOutside();
    for (const double number : {1.0, 2.0, 3.0}) send(number);
    step(1);
    EXPECT_EQ(value("/C", "order"), 123.0);
    send(4.0);
    step(2);
    EXPECT_EQ(value("/C", "order"), 1234.0);
    EXPECT_EQ(value("/C", "dropped"), 0.0);
}

TEST_F(Queues, DroppedMessagesAreCounted) {
    loadOutside();
    for (int number = 1; number <= 7; ++number) send(number);
    step(1);
    EXPECT_EQ(value("/C", "order"), 1234.0);
    EXPECT_EQ(value("/C", "dropped"), 3.0);
    setParameters("/C", {{"takes", false}});
    for (int round = 0; round < 2; ++round) {
        for (int number = 5; number <= 7; ++number) send(number);
        step(1);
    }
    EXPECT_EQ(value("/C", "waiting"), 4.0);
    EXPECT_EQ(value("/C", "dropped"), 5.0);
    setParameters("/C", {{"takes", true}});
    step(1);
    EXPECT_EQ(value("/C", "order"), 12345675.0);
}

TEST_F(Queues, TextsArriveCompletelyAndTheirMemoryIsReused) {
    loadOutside();
    double letters = 0.0;
    for (int round = 0; round < 20; ++round) {
        for (int each = 0; each < 3; ++each) {
            sendText(std::string(static_cast<std::size_t>(round), 'x'));
            letters += round;
        }
        step(1);
        ASSERT_EQ(value("/C", "letters"), letters);
    }
}

TEST_F(Queues, AComponentGetsMessagesOfItsSkippedCycles) {
    load(definition("Digits", "D"));
    ComponentDefinition slow = collector("out");
    slow.every = 4;
    slow.phase = 3;
    load(slow);
    step(8);
    EXPECT_EQ(value("/C", "order"), 1234567.0);
    EXPECT_EQ(value("/C", "dropped"), 0.0);
}

TEST_F(Queues, ALoopBreakIsACycleLateAndLosesNothing) {
    load(definition("Digits", "D"));
    ComponentDefinition early = collector("out");
    early.breaks.ports = {"in"};
    load(early);
    step(5);
    EXPECT_EQ(value("/C", "order"), 123.0) << "the value of cycle 4 arrives in cycle 5";
}

TEST_F(Queues, TheEndOfALoopBreakLosesNothing) {
    load(definition("Digits", "D"));
    ComponentDefinition early = collector("out");
    early.breaks.ports = {"in"};
    load(early);
    step(5);
    ASSERT_EQ(value("/C", "order"), 123.0);
    for (const double order : {12345.0, 12345678.0}) {
        setBreak("/C", "in", false);
        step(1);
        EXPECT_EQ(value("/C", "order"), order);
        setBreak("/C", "in", true);
        step(2);
        EXPECT_EQ(value("/C", "order"), order * 10.0 + std::fmod(order, 10.0) + 1.0);
    }
    EXPECT_EQ(value("/C", "dropped"), 0.0);
}

TEST_F(Queues, ASuccessorGetsNoMessageTwice) {
    load(definition("Digits", "D"));
    load(collector("out"));
    step(3);
    ASSERT_EQ(value("/C", "order"), 12.0);
    replace("/C", collector("out"));
    step(2);
    EXPECT_EQ(value("/C", "order"), 1234.0);
}

TEST_F(Queues, AQueueKeepsItsMessagesWhenItsWriterChanges) {
    loadOutside();
    setParameters("/C", {{"takes", false}});
    send(1.0);
    send(2.0);
    step(1);
    ComponentDefinition writer = definition("Digits", "D");
    writer.remaps = {{"out", "commands"}};
    load(writer);
    step(2);
    unload("/D");
    setParameters("/C", {{"takes", true}});
    step(1);
    // Iterations 1 and 2 have written 1 and 2.
    EXPECT_EQ(value("/C", "order"), 1212.0);
    send(5.0);
    step(1);
    EXPECT_EQ(value("/C", "order"), 12125.0);
}

TEST_F(Queues, ASnapshotHasNoQueuedMessages) {
    loadOutside();
    setParameters("/C", {{"takes", false}});
    send(1.0);
    step(1);
    const auto snapshot = onGraphThread([&] { return runner().takeSnapshot().snapshot; });
    send(2.0);
    step(1);
    onGraphThread([&] { return runner().restore(snapshot, [](const std::string&) {}); });
    setParameters("/C", {{"takes", true}});
    send(3.0);
    step(1);
    EXPECT_EQ(value("/C", "order"), 3.0);
}

}  // namespace
}  // namespace rtcf::test
