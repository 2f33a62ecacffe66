#include "exchange/serialized_tap.hpp"

#include <gtest/gtest.h>
#include <std_msgs/String.h>

#include <atomic>
#include <cstring>
#include <memory>
#include <new>
#include <string>
#include <thread>
#include <vector>

#include "rtcf/component.hpp"

namespace rtcf::test {

struct Words {
    std::uint32_t letters = 0;
};
// Records the thread that calls the conversion; can also throw, or have no message.
struct WordsOnRos {
    static const char* name() { return "Words"; }
    static void toMessage(const Words& value, std_msgs::String& message) {
        converted_by = std::this_thread::get_id();
        if (value.letters == 13) throw std::bad_alloc();
        message.data.assign(value.letters, 'x');
    }
    static void fromMessage(const std_msgs::String& message, Words& value) {
        value.letters = static_cast<std::uint32_t>(message.data.size());
    }
    static inline std::thread::id converted_by;
};

}  // namespace rtcf::test

template <>
struct rtcf::PortType<rtcf::test::Words>
    : rtcf::MappedPortType<rtcf::test::Words, std_msgs::String, rtcf::test::WordsOnRos> {};

namespace rtcf::test {
namespace {

using executor::SerializedTap;
using executor::Tap;

template <typename T>
void write(const std::shared_ptr<Slot<T>>& slot, const T& value) {
    slot->value = value;
    ++slot->stamp;
}

std::vector<double> takeAll(Tap& tap) {
    std::vector<double> values;
    while (tap.pop([&](const std::uint8_t* bytes, std::uint32_t size, std::int64_t) {
        ASSERT_EQ(size, sizeof(double));
        double value = 0.0;
        std::memcpy(&value, bytes, size);
        values.push_back(value);
    })) {
    }
    return values;
}

TEST(SerializedTap, PassesEachWrittenValueOnce) {
    const auto slot = std::make_shared<Slot<double>>();
    SerializedTap tap("/x", typeInfo<double>(), slot, 1024);
    tap.push(0);
    EXPECT_TRUE(takeAll(tap).empty()) << "nothing was written yet";
    write(slot, 1.0);
    tap.push(0);
    tap.push(0);
    write(slot, 2.0);
    tap.push(0);
    EXPECT_EQ(takeAll(tap), (std::vector<double>{1.0, 2.0}));
    EXPECT_FALSE(tap.pop([](const std::uint8_t*, std::uint32_t, std::int64_t) {}));
}

// A restored value may have the stamp of the one before.
TEST(SerializedTap, PassesAReplacedValueOfTheSameStamp) {
    const auto slot = std::make_shared<Slot<double>>();
    SerializedTap tap("/x", typeInfo<double>(), slot, 1024);
    tap.forget();
    tap.push(0);
    EXPECT_TRUE(takeAll(tap).empty()) << "nothing was written yet";
    write(slot, 1.0);
    tap.push(0);
    slot->value = 2.0;
    tap.forget();
    tap.push(0);
    tap.push(0);
    EXPECT_EQ(takeAll(tap), (std::vector<double>{1.0, 2.0}));
}

TEST(SerializedTap, HasTheStampOfTheCycleThatWroteAValue) {
    const auto slot = std::make_shared<Slot<double>>();
    SerializedTap tap("/x", typeInfo<double>(), slot, 64);
    for (std::int64_t stamp = 1'700'000'000'000'000'000; stamp < 1'700'000'000'000'000'020;
         ++stamp) {
        write(slot, 1.0);
        tap.push(stamp);
        std::int64_t told = 0;
        ASSERT_TRUE(tap.pop(
            [&](const std::uint8_t*, std::uint32_t, std::int64_t stamp_ns) { told = stamp_ns; }));
        ASSERT_EQ(told, stamp);
    }
}

// Building a message allocates; the cycle only copies the value.
TEST(SerializedTap, BuildsMessagesInTheReadersThread) {
    const auto slot = std::make_shared<Slot<Words>>();
    SerializedTap tap("/x", typeInfo<Words>(), slot, 1024, 64);
    WordsOnRos::converted_by = {};
    std::thread loop([&] {
        for (const std::uint32_t letters : {3U, 5U}) {
            write(slot, Words{letters});
            tap.push(letters);
        }
    });
    loop.join();
    EXPECT_EQ(WordsOnRos::converted_by, std::thread::id());
    std::vector<std::string> texts;
    std::vector<std::int64_t> stamps;
    while (tap.pop([&](const std::uint8_t* bytes, std::uint32_t size, std::int64_t stamp_ns) {
        Slot<std_msgs::String> message;
        ASSERT_TRUE(typeInfo<std_msgs::String>().deserialize(message, bytes, size));
        texts.push_back(message.value.data);
        stamps.push_back(stamp_ns);
    })) {
    }
    EXPECT_EQ(WordsOnRos::converted_by, std::this_thread::get_id());
    EXPECT_EQ(texts, (std::vector<std::string>{"xxx", "xxxxx"}));
    EXPECT_EQ(stamps, (std::vector<std::int64_t>{3, 5}));
}

TEST(SerializedTap, CountsMessagesThatCannotBeBuilt) {
    const auto slot = std::make_shared<Slot<Words>>();
    SerializedTap tap("/x", typeInfo<Words>(), slot, 1024, 64);
    for (const std::uint32_t letters : {13U, 100U, 1U}) {
        write(slot, Words{letters});
        tap.push(0);
    }
    std::size_t taken = 0;
    while (tap.pop([&](const std::uint8_t*, std::uint32_t, std::int64_t) { ++taken; })) {
    }
    EXPECT_EQ(taken, 1U);
    EXPECT_EQ(tap.dropped(), 1U) << "its conversion throws";
    EXPECT_EQ(tap.tooLarge(), 1U);
}

// A topic that is closed and reopened while its old reader still exists.
TEST(SerializedTap, OneOfTwoSimultaneousReadersFindsNothing) {
    const auto slot = std::make_shared<Slot<double>>();
    SerializedTap tap("/x", typeInfo<double>(), slot, 1024);
    for (const double value : {1.0, 2.0}) {
        write(slot, value);
        tap.push(0);
    }
    EXPECT_TRUE(tap.pop([&](const std::uint8_t*, std::uint32_t, std::int64_t) {
        std::thread other([&] {
            EXPECT_FALSE(tap.pop([](const std::uint8_t*, std::uint32_t, std::int64_t) {}));
        });
        other.join();
    }));
    EXPECT_EQ(takeAll(tap), std::vector<double>{2.0});
}

TEST(SerializedTap, PassesTheFirstValueAndThenEachNth) {
    const auto slot = std::make_shared<Slot<double>>();
    SerializedTap tap("/x", typeInfo<double>(), slot, 1024);
    tap.setDecimation(3);
    for (int i = 1; i <= 8; ++i) {
        write(slot, static_cast<double>(i));
        tap.push(0);
    }
    EXPECT_EQ(takeAll(tap), (std::vector<double>{1.0, 4.0, 7.0}));
    tap.setDecimation(1);
    write(slot, 9.0);
    tap.push(0);
    EXPECT_EQ(takeAll(tap), (std::vector<double>{9.0}));
    EXPECT_EQ(tap.dropped(), 0U);
}

TEST(SerializedTap, CountsValuesAboveTheLimit) {
    const auto slot = std::make_shared<Slot<std_msgs::String>>();
    SerializedTap tap("/x", typeInfo<std_msgs::String>(), slot, 1024, 104);
    std_msgs::String text;
    text.data.assign(100, 'x');  // plus its length, 4 bytes
    write(slot, text);
    tap.push(0);
    EXPECT_EQ(tap.tooLarge(), 0U);
    text.data.assign(101, 'x');
    write(slot, text);
    tap.push(0);
    EXPECT_EQ(tap.tooLarge(), 1U);
    EXPECT_EQ(tap.dropped(), 0U);
    EXPECT_TRUE(tap.pop(
        [](const std::uint8_t*, std::uint32_t size, std::int64_t) { EXPECT_EQ(size, 104U); }));
    EXPECT_FALSE(tap.pop([](const std::uint8_t*, std::uint32_t, std::int64_t) {}));
}

TEST(SerializedTap, WrapsAroundAtTheEndOfItsRing) {
    for (const std::size_t capacity : {32, 40, 48, 56, 104}) {
        const auto slot = std::make_shared<Slot<double>>();
        SerializedTap tap("/x", typeInfo<double>(), slot, capacity);
        for (int i = 1; i < 100; ++i) {
            write(slot, static_cast<double>(i));
            tap.push(0);
            ASSERT_EQ(takeAll(tap), std::vector<double>{static_cast<double>(i)})
                << "ring of " << capacity;
        }
        EXPECT_EQ(tap.dropped(), 0U);
    }
}

TEST(SerializedTap, FullRingDropsTheNewestAndCounts) {
    const auto slot = std::make_shared<Slot<double>>();
    SerializedTap tap("/x", typeInfo<double>(), slot, 128);  // five records of 16 + 8 bytes
    for (int i = 1; i <= 7; ++i) {
        write(slot, static_cast<double>(i));
        tap.push(0);
    }
    EXPECT_EQ(tap.dropped(), 2U);
    EXPECT_EQ(takeAll(tap), (std::vector<double>{1.0, 2.0, 3.0, 4.0, 5.0}));
    write(slot, 8.0);
    tap.push(0);
    EXPECT_EQ(takeAll(tap), std::vector<double>{8.0});
}

TEST(SerializedTap, RingTooSmallForAValueIsEnlarged) {
    const auto slot = std::make_shared<Slot<double>>();
    SerializedTap tap("/x", typeInfo<double>(), slot, 1);
    write(slot, 1.0);
    tap.push(0);
    EXPECT_EQ(takeAll(tap).size(), 1U);
}

TEST(SerializedTap, ValueLargerThanTheRingIsDroppedAndCounted) {
    const auto slot = std::make_shared<Slot<std_msgs::String>>();
    SerializedTap tap("/x", typeInfo<std_msgs::String>(), slot, 128);
    std_msgs::String text;
    text.data.assign(200, 'x');
    write(slot, text);
    tap.push(0);
    EXPECT_EQ(tap.dropped(), 1U);
    text.data = "small";
    write(slot, text);
    tap.push(0);
    EXPECT_TRUE(tap.pop(
        [](const std::uint8_t*, std::uint32_t size, std::int64_t) { EXPECT_EQ(size, 9U); }));
}

TEST(SerializedTap, ValuesOfAllLengthsAreUnchanged) {
    const auto slot = std::make_shared<Slot<std_msgs::String>>();
    SerializedTap tap("/x", typeInfo<std_msgs::String>(), slot, 256);
    for (std::size_t length = 0; length < 500; ++length) {
        std_msgs::String text;
        text.data.assign(length % 90, static_cast<char>('a' + length % 26));
        write(slot, text);
        tap.push(0);
        std::string bytes;
        ASSERT_TRUE(tap.pop([&](const std::uint8_t* data, std::uint32_t size, std::int64_t) {
            bytes.assign(reinterpret_cast<const char*>(data), size);
        }));
        ASSERT_EQ(bytes.substr(4), text.data);
    }
    EXPECT_EQ(tap.dropped(), 0U);
}

TEST(SerializedTap, ConsumerInAnotherThreadGetsAllValuesNotDropped) {
    constexpr int kCount = 100'000;
    const auto slot = std::make_shared<Slot<double>>();
    SerializedTap tap("/x", typeInfo<double>(), slot, 1000);
    std::atomic<bool> done{false};
    std::thread producer([&] {
        for (int i = 1; i <= kCount; ++i) {
            write(slot, static_cast<double>(i));
            tap.push(0);
        }
        done = true;
    });
    std::uint64_t taken = 0;
    double last = 0.0;
    for (bool over = false; !over;) {
        over = done;
        for (const double value : takeAll(tap)) {
            ASSERT_GT(value, last);
            last = value;
            ++taken;
        }
    }
    producer.join();
    EXPECT_EQ(taken + tap.dropped(), static_cast<std::uint64_t>(kCount));
}

}  // namespace
}  // namespace rtcf::test
