#include "exchange/injector.hpp"

#include <gtest/gtest.h>
#include <std_msgs/Float64MultiArray.h>
#include <std_msgs/String.h>
#include <sys/resource.h>

#include <atomic>
#include <cstring>
#include <thread>
#include <vector>

#include "rtcf/component.hpp"
#include "support/bare_component.hpp"

namespace rtcf::test {
namespace {

using executor::Injector;

std::vector<std::uint8_t> bytesOf(double value) {
    std::vector<std::uint8_t> bytes(sizeof value);
    std::memcpy(bytes.data(), &value, sizeof value);
    return bytes;
}

bool deliver(Injector& injector, double value) {
    const auto bytes = bytesOf(value);
    return injector.deliver(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
}

double front(const Injector& injector) {
    return static_cast<const Slot<double>*>(injector.front())->value;
}

TEST(Injector, StartsEmpty) {
    Injector injector("/x", typeInfo<double>());
    EXPECT_FALSE(injector.adopt(LoopClock{}));
    EXPECT_EQ(injector.front()->stamp, 0);
}

TEST(Injector, PassesSkippedMessagesToABacklog) {
    Injector injector("/x", typeInfo<double>());
    BareComponent component;
    Queue<double, 8> queue(&component, "queue");
    const auto backlog = std::make_shared<executor::Backlog>(queue);
    injector.setBacklogs({backlog});
    for (const double value : {1.0, 2.0, 3.0}) EXPECT_TRUE(deliver(injector, value));
    injector.setQueueing(true);
    for (const double value : {4.0, 5.0}) EXPECT_TRUE(deliver(injector, value));
    injector.deliverUntil(INT64_MAX);
    backlog->enter(100);
    for (const double value : {1.0, 2.0, 3.0, 4.0, 5.0}) {
        ASSERT_NE(queue.front(), nullptr);
        EXPECT_EQ(*queue.front(), value);
        queue.pop();
    }
    EXPECT_EQ(queue.front(), nullptr);
    EXPECT_EQ(injector.passedOver(), 0U);
    injector.setQueueing(false);
    const std::uint8_t short_one[] = {1, 2};
    EXPECT_FALSE(injector.deliver(short_one, sizeof short_one));
    backlog->enter(200);
    EXPECT_EQ(queue.size(), 0U) << "a queue gets no invalid messages";
}

TEST(Injector, CountsAndRejectsMessagesAboveTheLimit) {
    Injector injector("/x", typeInfo<std_msgs::String>());
    injector.setLargest(6);
    const std::vector<std::uint8_t> fits{2, 0, 0, 0, 'h', 'i'};
    const std::vector<std::uint8_t> large{3, 0, 0, 0, 'h', 'e', 'y'};
    EXPECT_TRUE(injector.deliver(fits.data(), 6));
    EXPECT_FALSE(injector.deliver(large.data(), 7));
    EXPECT_EQ(injector.tooLarge(), 1U);
    EXPECT_EQ(injector.delivered(), 1U);
    EXPECT_TRUE(injector.adopt(LoopClock{}));
    const auto* slot = static_cast<const Slot<std_msgs::String>*>(injector.front());
    EXPECT_EQ(slot->value.data, "hi");
}

// Peak memory in KiB.
long mostMemory() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return usage.ru_maxrss;
}

// A length in a message reserves no memory until the bytes have arrived.
TEST(Injector, ReservesNoMemoryForMissingBytes) {
    constexpr long kLittle = 16 * 1024;  // KiB
    Injector numbers("/x", typeInfo<std_msgs::Float64MultiArray>());
    std::vector<std::uint8_t> bytes(12);
    const std::uint32_t dimensions = 8U << 20U;  // of 40 bytes each: 320 MiB
    std::memcpy(bytes.data(), &dimensions, sizeof dimensions);
    long before = mostMemory();
    EXPECT_FALSE(numbers.deliver(bytes.data(), 12));
    EXPECT_LT(mostMemory() - before, kLittle);

    bytes.assign(12, 0);
    const std::uint32_t count = 1U << 29U;  // times 8 bytes is 0 in 32 bits: 4 GiB of "valid" zeros
    std::memcpy(bytes.data() + 8, &count, sizeof count);
    before = mostMemory();
    EXPECT_FALSE(numbers.deliver(bytes.data(), 12));
    EXPECT_LT(mostMemory() - before, kLittle);
}

TEST(Injector, ReturnsTheNewestOfSeveral) {
    Injector injector("/x", typeInfo<double>());
    for (int i = 1; i <= 5; ++i) deliver(injector, i);
    EXPECT_TRUE(injector.adopt(LoopClock{}));
    EXPECT_EQ(front(injector), 5.0);
    EXPECT_FALSE(injector.adopt(LoopClock{})) << "no newer value exists";
    EXPECT_EQ(front(injector), 5.0);
    EXPECT_EQ(injector.delivered(), 5U);
}

TEST(Injector, StampsWithTheLoopsClock) {
    Injector injector("/x", typeInfo<double>());
    LoopClock clock;
    for (const std::int64_t time : {1234, 1235, 1236}) {
        clock.time_ns = time;
        deliver(injector, 1.0);
        ASSERT_TRUE(injector.adopt(clock));
        EXPECT_EQ(injector.front()->stamp, time);
    }
}

// Loop time begins near 0, and its stamp 0 means "never written".
TEST(Injector, KeepsTheAgesOfMessagesOlderThanTheLoop) {
    for (const std::int64_t age : {99, 100, 101, 102}) {
        Injector injector("/x", typeInfo<double>());
        BareComponent component;
        Queue<double, 1> queue(&component, "queue");
        const auto backlog = std::make_shared<executor::Backlog>(queue);
        injector.setBacklogs({backlog});
        injector.setQueueing(true);
        const auto bytes = bytesOf(1.0);
        ASSERT_TRUE(injector.deliver(bytes.data(), static_cast<std::uint32_t>(bytes.size()), 1));
        injector.deliverUntil(1 + age, 1.0);
        component.loop_clock.time_ns = 100;
        accessTo(component).setTime(100);
        ASSERT_TRUE(injector.adopt(component.loop_clock));
        EXPECT_NE(injector.front()->stamp, 0);
        EXPECT_EQ(100 - timeOf(injector.front()->stamp), age);
        backlog->enter(100);
        EXPECT_EQ(queue.age(), age);
    }
}

TEST(Injector, RejectsInvalidMessagesAndKeepsTheLastOne) {
    Injector injector("/x", typeInfo<double>());
    deliver(injector, 1.0);
    const std::vector<std::uint8_t> few(3);
    EXPECT_FALSE(injector.deliver(few.data(), 3));
    EXPECT_EQ(injector.refused(), 1U);
    EXPECT_EQ(injector.delivered(), 1U);
    ASSERT_TRUE(injector.adopt(LoopClock{}));
    EXPECT_EQ(front(injector), 1.0);
}

// Values of two equal numbers: neither thread may see them differ.
TEST(Injector, IsNeverTornBetweenTwoThreads) {
    constexpr int kCount = 100'000;
    Injector injector("/x", typeInfo<std_msgs::String>());
    std::atomic<bool> done{false};
    std::thread producer([&] {
        for (std::uint32_t i = 1; i <= kCount; ++i) {
            // A string of 8 bytes: i, twice.
            std::vector<std::uint8_t> bytes(12);
            const std::uint32_t length = 8;
            std::memcpy(bytes.data(), &length, 4);
            std::memcpy(bytes.data() + 4, &i, 4);
            std::memcpy(bytes.data() + 8, &i, 4);
            injector.deliver(bytes.data(), 12);
        }
        done = true;
    });
    std::uint32_t last = 0;
    for (bool over = false; !over;) {
        over = done;
        if (!injector.adopt(LoopClock{})) continue;
        const std::string& text =
            static_cast<const Slot<std_msgs::String>*>(injector.front())->value.data;
        ASSERT_EQ(text.size(), 8U);
        std::uint32_t first = 0;
        std::uint32_t second = 0;
        std::memcpy(&first, text.data(), 4);
        std::memcpy(&second, text.data() + 4, 4);
        ASSERT_EQ(first, second);
        ASSERT_GT(first, last);
        last = first;
    }
    producer.join();
    EXPECT_EQ(last, static_cast<std::uint32_t>(kCount)) << "the newest wins";
}

}  // namespace
}  // namespace rtcf::test
