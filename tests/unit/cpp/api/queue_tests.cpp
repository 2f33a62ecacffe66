// Queues wired by hand, and in a bench of rtcf/test.hpp.
#include <gtest/gtest.h>
#include <std_msgs/String.h>

#include <array>
#include <string>
#include <vector>

#include "exchange/backlog.hpp"
#include "rtcf/queue.hpp"
#include "rtcf/test.hpp"
#include "support/bare_component.hpp"

namespace rtcf::test {
namespace {

class QueueAlone : public ::testing::Test {
   protected:
    // As at a boundary, like Rewire::apply().
    void connect(OutputBase& output) {
        as_executor.receive();
        accessTo(component).inputs().front()->connect(portOf(component, output).slot().get(),
                                                      false);
        as_executor.skip();
    }
    void write(Output<int>& output, int value) { write(output, value, component.time() + 1); }
    void write(Output<int>& output, int value, std::int64_t time_ns) {
        accessTo(component).setTime(time_ns);
        output.write(value);
        as_executor.receive();
    }
    std::vector<int> taken() {
        std::vector<int> values;
        while (const int* value = queue.front()) {
            values.push_back(*value);
            queue.pop();
        }
        return values;
    }

    BareComponent component;
    Queue<int, 3> queue{&component, "queue"};
    QueueBase& as_executor = queue;
    Output<int> first{&component, "first"};
    Output<int> second{&component, "second"};
};

TEST_F(QueueAlone, StartsEmpty) {
    EXPECT_EQ(queue.front(), nullptr);
    EXPECT_EQ(queue.size(), 0U);
    EXPECT_EQ(queue.age(), -1);
    queue.pop();
    EXPECT_EQ(queue.size(), 0U);
    EXPECT_FALSE(queue.connected());
}

TEST_F(QueueAlone, KeepsMessagesInOrder) {
    connect(first);
    for (int round = 0; round < 5; ++round) {
        write(first, 3 * round);
        write(first, 3 * round + 1);
        EXPECT_EQ(queue.size(), 2U);
        EXPECT_EQ(taken(), (std::vector<int>{3 * round, 3 * round + 1}));
    }
    EXPECT_EQ(queue.dropped(), 0U);
}

TEST_F(QueueAlone, AWriteIsSeenImmediatelyAndOnce) {
    connect(first);
    first.write(7);
    ASSERT_NE(queue.front(), nullptr);
    EXPECT_EQ(*queue.front(), 7);
    EXPECT_EQ(queue.size(), 1U);
    queue.pop();
    EXPECT_EQ(queue.front(), nullptr);
}

TEST_F(QueueAlone, CountsDroppedMessages) {
    connect(first);
    for (int i = 0; i < 8; ++i) write(first, i);
    EXPECT_EQ(queue.dropped(), 5U);
    EXPECT_EQ(taken(), (std::vector<int>{0, 1, 2}));
    write(first, 9);
    EXPECT_EQ(taken(), std::vector<int>{9});
    EXPECT_EQ(queue.dropped(), 5U);
}

TEST_F(QueueAlone, AValueWrittenBeforeTheConnectionIsNoMessage) {
    first.write(1);
    connect(first);
    EXPECT_EQ(queue.size(), 0U);
    write(first, 2);
    second.write(3);
    connect(second);
    write(second, 4);
    EXPECT_EQ(taken(), (std::vector<int>{2, 4}));
}

TEST_F(QueueAlone, AgeIsThatOfTheOldestMessage) {
    connect(first);
    write(first, 1, 100);
    write(first, 2, 300);
    accessTo(component).setTime(450);
    EXPECT_EQ(queue.age(), 350);
    queue.pop();
    EXPECT_EQ(queue.age(), 150);
}

// A new run of the loop begins at an earlier time.
TEST_F(QueueAlone, MessagesKeepTheirAgesIfTheTimeMoves) {
    connect(first);
    write(first, 1, 600);
    queue.pop();
    write(first, 2, 1000);
    write(first, 3, 1200);
    as_executor.moveTime(-1500);
    accessTo(component).setTime(10);
    EXPECT_EQ(queue.age(), 510);
    queue.pop();
    EXPECT_EQ(queue.age(), 310);
    queue.pop();
    as_executor.moveTime(-1500);
    EXPECT_EQ(queue.age(), -1);
}

TEST_F(QueueAlone, MessagesOfVariableSizeKeepTheirCapacity) {
    Queue<std_msgs::String, 2> texts{&component, "texts"};
    Output<std_msgs::String> output{&component, "output"};
    std_msgs::String longest;
    longest.data = std::string(100, 'x');
    texts.reserve(longest);
    accessTo(component).inputs().back()->connect(portOf(component, output).slot().get(), false);
    for (int round = 0; round < 4; ++round) {
        accessTo(component).setTime(component.time() + 1);
        output.value().data = "a text that is longer than what a string has at hand";
        output.publish();
        const char* const place = texts.front()->data.data();
        EXPECT_EQ(texts.front()->data.substr(0, 6), "a text");
        EXPECT_GE(texts.front()->data.capacity(), 100U) << static_cast<const void*>(place);
        texts.pop();
    }
}

class Summing final : public Component {
    Queue<double, 4> in{this, "in"};
    Output<double> sum{this, "sum"};

    void update() override {
        double total = 0.0;
        for (; const double* value = in.front(); in.pop()) total += *value;
        sum.write(total);
    }
};
RTCF_COMPONENT(Summing, "sums up a queue")

// Memory of messages from a topic moves to the queue, and then to a topic.
TEST_F(QueueAlone, ATopicUsesNoReservedMemory) {
    Queue<std_msgs::String, 3> texts{&component, "texts"};
    std_msgs::String longest;
    longest.data.assign(100, 'x');
    texts.reserve(longest);
    executor::Backlog backlog(texts);
    const std::array<std::uint8_t, 5> message{1, 0, 0, 0, 'a'};
    for (int round = 0; round < 10; ++round) {
        backlog.store(message.data(), message.size(), 0);
        backlog.enter(0);
        ASSERT_NE(texts.front(), nullptr);
        EXPECT_EQ(texts.front()->data, "a");
        EXPECT_GE(texts.front()->data.capacity(), 100U) << round;
        texts.pop();
    }
}

TEST(QueueInABench, ReceivesEachWrite) {
    Bench bench("Summing");
    for (const double value : {1.0, 2.0, 4.0}) bench.write("in", value);
    bench.cycle();
    EXPECT_EQ(*bench.read<double>("sum"), 7.0);
    bench.cycle();
    EXPECT_EQ(*bench.read<double>("sum"), 0.0);
}

}  // namespace
}  // namespace rtcf::test
