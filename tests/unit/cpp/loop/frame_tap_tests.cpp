#include "loop/frame_tap.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <cstring>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "rtcf/component.hpp"

namespace rtcf::test {

struct Unlucky {
    double number = 0.0;
};

}  // namespace rtcf::test

// Its message cannot be built if the number is 13.
template <>
struct rtcf::PortType<rtcf::test::Unlucky> : rtcf::PortType<double> {
    using Unlucky = rtcf::test::Unlucky;
    static constexpr bool kPlain = false;
    static std::uint32_t length(const Unlucky& value) {
        return PortType<double>::length(value.number);
    }
    static void serialize(const Unlucky& value, std::uint8_t* to, std::uint32_t size) {
        if (value.number == 13.0) throw std::runtime_error("unlucky");
        PortType<double>::serialize(value.number, to, size);
    }
    static void deserialize(Unlucky& value, const std::uint8_t* from, std::uint32_t size) {
        PortType<double>::deserialize(value.number, from, size);
    }
    static std::string print(const Unlucky& value) { return PortType<double>::print(value.number); }
    static std::string sample() { return PortType<double>::sample(); }
    static ByteCopies copies() { return std::nullopt; }
};

namespace rtcf::test {
namespace {

using executor::CycleCounter;
using executor::FrameKind;
using executor::FrameRing;
using executor::FrameTap;
using executor::Tap;

// An output of type T, its tap, and the frames of its loop.
template <typename T = double>
struct TappedOutputOf {
    explicit TappedOutputOf(std::size_t frames = 64) : capacity(frames) { takeRing(); }

    void takeRing() {
        ring = std::make_shared<FrameRing>(
            std::vector<FrameRing::Source>{{slot.get(), sizeof *slot, sizeof(SlotHeader)}}, 0,
            capacity, CycleCounter());
        ring->setBase();
        tap.follow(ring, 0);
    }
    void cycle(std::int64_t stamp_ns = 0) {
        ++time;
        ring->begin({0, stamp_ns, 0, 0, 0, FrameKind::Counted, std::exchange(restored, false)});
        ring->take();
        ring->commit(0);
    }
    void write(const T& value, std::int64_t stamp_ns = 0) {
        slot->value = value;
        slot->stamp = time + 1;
        cycle(stamp_ns);
    }
    void moveTime(std::int64_t by) {
        slot->stamp = movedStamp(slot->stamp, by);
        time += by;
        tap.moveTime(by);
        ring->setBase();
    }
    // A change at a boundary replaces the value, as the restoration of a snapshot does.
    void restore(const T& value, std::int64_t stamp) {
        slot->value = value;
        slot->stamp = stamp;
        ring->setBase();
        restored = true;
    }

    const std::size_t capacity;
    std::int64_t time = 1000;  // of the last cycle
    bool restored = false;     // since the last cycle
    const std::shared_ptr<Slot<T>> slot = std::make_shared<Slot<T>>();
    std::shared_ptr<FrameRing> ring;
    FrameTap tap{"/x", typeInfo<T>(), slot};
};
using TappedOutput = TappedOutputOf<>;

bool popOne(Tap& tap, double& value) {
    return tap.pop([&value](const std::uint8_t* bytes, std::uint32_t size, std::int64_t) {
        ASSERT_EQ(size, sizeof value);
        std::memcpy(&value, bytes, sizeof value);
    });
}

std::vector<double> popAll(Tap& tap) {
    std::vector<double> values;
    for (double value = 0.0; popOne(tap, value);) values.push_back(value);
    return values;
}

TEST(FrameTap, PassesEachWrittenValueOnce) {
    TappedOutput loop;
    loop.cycle();
    EXPECT_TRUE(popAll(loop.tap).empty()) << "nothing was written yet";
    loop.write(1.0);
    loop.cycle();
    loop.write(2.0);
    EXPECT_EQ(popAll(loop.tap), (std::vector<double>{1.0, 2.0}));
    loop.cycle();
    EXPECT_TRUE(popAll(loop.tap).empty());
}

TEST(FrameTap, HasTheStampOfTheCycleThatWroteAValue) {
    TappedOutput loop;
    for (const std::int64_t stamp : {1'700'000'000'000'000'000, 1'700'000'000'000'000'001}) {
        loop.write(1.0, stamp);
        loop.cycle(stamp + 500);
        std::int64_t told = 0;
        ASSERT_TRUE(loop.tap.pop(
            [&](const std::uint8_t*, std::uint32_t, std::int64_t stamp_ns) { told = stamp_ns; }));
        EXPECT_EQ(told, stamp);
    }
}

TEST(FrameTap, BeginsWithTheValueThatThereIs) {
    TappedOutput loop;
    loop.write(1.0);
    loop.write(2.0);
    loop.ring->setBase();
    FrameTap tap("/x", typeInfo<double>(), loop.slot);
    tap.follow(loop.ring, 0);
    loop.cycle();
    EXPECT_EQ(popAll(tap), std::vector<double>{2.0});
}

TEST(FrameTap, ReadsTheRingBeforeToItsEnd) {
    TappedOutput loop;
    loop.write(1.0);
    EXPECT_EQ(popAll(loop.tap), std::vector<double>{1.0});
    loop.write(2.0);
    loop.takeRing();
    loop.cycle();
    loop.write(3.0);
    EXPECT_EQ(popAll(loop.tap), (std::vector<double>{2.0, 3.0}));
    EXPECT_EQ(loop.tap.dropped(), 0U);
}

TEST(FrameTap, KeepsFewRings) {
    TappedOutput loop;
    std::vector<std::weak_ptr<const FrameRing>> rings;
    for (int i = 1; i <= 20; ++i) {
        rings.emplace_back(loop.ring);
        loop.write(static_cast<double>(i));
        loop.takeRing();
    }
    EXPECT_TRUE(rings[13].expired());
    EXPECT_EQ(popAll(loop.tap), (std::vector<double>{15, 16, 17, 18, 19, 20}));
    EXPECT_TRUE(rings[19].expired()) << "it was read";
    loop.write(21.0);
    EXPECT_EQ(popAll(loop.tap), std::vector<double>{21.0});
    EXPECT_EQ(loop.tap.dropped(), 14U);
}

// Rings of which few have room beside each other.
TEST(FrameTap, KeepsNoLargeRings) {
    constexpr std::size_t kFrames = std::size_t{128} * 1024;  // of 80 bytes
    TappedOutput loop(kFrames);
    std::weak_ptr<const FrameRing> ring = loop.ring;
    loop.write(1.0);
    loop.takeRing();
    EXPECT_TRUE(ring.expired());
    EXPECT_TRUE(popAll(loop.tap).empty());
}

TEST(FrameTap, PassesNoValueAgainWhenTimeMoves) {
    for (const std::int64_t by : {-100, 5, 1'000'000}) {
        TappedOutput loop;
        loop.write(1.0);
        loop.cycle();
        loop.moveTime(by);
        loop.cycle();
        loop.write(2.0);
        EXPECT_EQ(popAll(loop.tap), (std::vector<double>{1.0, 2.0}));
        loop.moveTime(by);
        loop.cycle();
        EXPECT_TRUE(popAll(loop.tap).empty());
    }
}

// A restored value may have the stamp of the one before.
TEST(FrameTap, PassesARestoredValueOfTheSameStamp) {
    TappedOutput loop;
    loop.restore(0.0, 0);
    loop.cycle();
    EXPECT_TRUE(popAll(loop.tap).empty()) << "nothing was written yet";
    loop.write(1.0);
    loop.restore(2.0, loop.slot->stamp);
    loop.cycle();
    loop.cycle();
    EXPECT_EQ(popAll(loop.tap), (std::vector<double>{1.0, 2.0}));
}

TEST(FrameTap, EndsWithTheValueOfALeavingComponent) {
    TappedOutput loop;
    loop.write(1.0);
    loop.slot->value = 2.0;
    loop.slot->stamp = ++loop.time;
    loop.tap.finish(17);
    EXPECT_EQ(popAll(loop.tap), (std::vector<double>{1.0, 2.0}));
    EXPECT_TRUE(popAll(loop.tap).empty());

    TappedOutput other;
    other.write(1.0);
    other.tap.finish(17);
    EXPECT_EQ(popAll(other.tap), std::vector<double>{1.0}) << "safe() wrote nothing";
}

TEST(FrameTap, CountsValuesThatWereOverwritten) {
    TappedOutput loop(16);
    ASSERT_EQ(loop.ring->capacity(), 16U);
    for (int i = 1; i <= 20; ++i) loop.write(static_cast<double>(i));
    const std::vector<double> values = popAll(loop.tap);
    ASSERT_EQ(values.size(), 16U);
    EXPECT_EQ(values.front(), 5.0);
    EXPECT_EQ(loop.tap.dropped(), 4U);
    for (int i = 0; i < 40; ++i) loop.cycle();
    EXPECT_TRUE(popAll(loop.tap).empty());
    loop.write(21.0);
    EXPECT_EQ(popAll(loop.tap), std::vector<double>{21.0});
    EXPECT_EQ(loop.tap.dropped(), 4U) << "the overwritten frames had no new value";
}

TEST(FrameTap, PassesTheFirstValueAndThenEachNth) {
    TappedOutput loop;
    loop.tap.setDecimation(3);
    for (int i = 1; i <= 8; ++i) loop.write(static_cast<double>(i));
    EXPECT_EQ(popAll(loop.tap), (std::vector<double>{1.0, 4.0, 7.0}));
    loop.tap.setDecimation(1);
    loop.write(9.0);
    EXPECT_EQ(popAll(loop.tap), std::vector<double>{9.0});
    EXPECT_EQ(loop.tap.dropped(), 0U);
}

TEST(FrameTap, CountsMessagesThatCannotBeBuilt) {
    TappedOutputOf<Unlucky> loop;
    for (const double number : {12.0, 13.0, 14.0}) loop.write({number});
    std::vector<double> values;
    while (loop.tap.pop([&](const std::uint8_t* bytes, std::uint32_t, std::int64_t) {
        std::memcpy(&values.emplace_back(), bytes, sizeof(double));
    })) {
    }
    EXPECT_EQ(values, (std::vector<double>{12.0, 14.0}));
    EXPECT_EQ(loop.tap.dropped(), 1U);
}

// A topic that is closed and reopened while its old reader still exists.
TEST(FrameTap, OneOfTwoSimultaneousReadersFindsNothing) {
    TappedOutput loop;
    for (const double value : {1.0, 2.0}) loop.write(value);
    EXPECT_TRUE(loop.tap.pop([&](const std::uint8_t*, std::uint32_t, std::int64_t) {
        std::thread other([&] {
            EXPECT_FALSE(loop.tap.pop([](const std::uint8_t*, std::uint32_t, std::int64_t) {}));
        });
        other.join();
    }));
    EXPECT_EQ(popAll(loop.tap), std::vector<double>{2.0});
}

TEST(FrameTap, KnowsHowManyFramesItsReaderIsBehind) {
    TappedOutput loop;
    for (int i = 0; i < 5; ++i) loop.cycle();
    EXPECT_EQ(loop.tap.waiting(), 0U) << "there is no reader";
    popAll(loop.tap);
    for (int i = 0; i < 5; ++i) loop.cycle();
    EXPECT_EQ(loop.tap.waiting(), 5U);
}

TEST(FrameTap, AReaderInAnotherThreadGetsAllValuesNotDropped) {
#ifdef RTCF_SANITIZED
    constexpr int kCount = 20'000;
#else
    constexpr int kCount = 200'000;
#endif
    constexpr int kChanges = 20;
    TappedOutput loop;
    std::atomic<bool> done{false};
    std::thread writer([&] {
        for (int i = 1; i <= kCount; ++i) {
            loop.write(static_cast<double>(i));
            if (i % (kCount / kChanges) == 0) loop.moveTime(-10);
            if (i % (kCount / kChanges) == 7) loop.takeRing();
        }
        done = true;
    });
    std::uint64_t taken = 0;
    double last = 0.0;
    for (bool over = false; !over;) {
        over = done;
        for (const double value : popAll(loop.tap)) {
            ASSERT_GT(value, last);
            last = value;
            ++taken;
        }
    }
    writer.join();
    EXPECT_EQ(last, kCount);
    EXPECT_EQ(taken + loop.tap.dropped(), static_cast<std::uint64_t>(kCount));
}

// All that a loop does, in random order, against the list of the values written.
TEST(FrameTap, PassesTheValuesOfAnyHistory) {
    for (unsigned seed = 0; seed < 300; ++seed) {
        std::mt19937 random(seed);
        const auto below = [&random](int end) {
            return std::uniform_int_distribution<>(0, end - 1)(random);
        };
        TappedOutput loop(1024);
        std::vector<double> wanted;
        std::vector<double> taken;
        bool restored = false;  // and no cycle has run since
        double next = 0.0;
        for (int i = 0; i < 200; ++i) {
            const int kind = below(20);
            if (kind < 6) {
                loop.write(++next);
                wanted.push_back(next);
                restored = false;
            } else if (kind < 12) {
                loop.cycle();
                if (std::exchange(restored, false)) wanted.push_back(loop.slot->value);
            } else if (kind < 14) {
                // A snapshot's values may be as old as the loop.
                loop.restore(++next, 1 + below(static_cast<int>(loop.time)));
                restored = true;
            } else if (kind < 16) {
                loop.moveTime(below(40) - (loop.time > 900 ? 30 : 0));
            } else if (kind == 16) {
                loop.takeRing();
            }
            double value = 0.0;
            for (int pops = kind > 16 ? below(10) : 1; pops > 0 && popOne(loop.tap, value); --pops)
                taken.push_back(value);
        }
        for (const double value : popAll(loop.tap)) taken.push_back(value);
        ASSERT_EQ(taken, wanted) << "seed " << seed;
        ASSERT_EQ(loop.tap.dropped(), 0U) << "seed " << seed;
    }
}

}  // namespace
}  // namespace rtcf::test
