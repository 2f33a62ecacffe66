#include "frames/frame_ring.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <cstring>
#include <thread>
#include <vector>

namespace rtcf::test {
namespace {

using executor::CycleCounter;
using executor::Frame;
using executor::FrameKind;
using executor::FrameRing;

#ifdef RTCF_SANITIZED
constexpr std::uint64_t kManyFrames = 20'000;
#else
constexpr std::uint64_t kManyFrames = 200'000;
#endif

const CycleCounter kNsCounter;  // one tick takes 1 ns

FrameRing ringOf(std::vector<FrameRing::Source> sources, std::size_t frames = 16) {
    return {std::move(sources), 0, frames, kNsCounter};
}

void fill(FrameRing& ring, std::uint64_t iteration) {
    const auto number = static_cast<std::int64_t>(iteration);
    ring.begin({iteration, 10 * number, -number, number, number});
    ring.take();
    ring.commit(4 * number);
}

template <typename T>
T valueAt(const Frame& frame, std::size_t offset) {
    T value{};
    std::memcpy(&value, frame.values() + offset, sizeof value);
    return value;
}

TEST(FrameRing, HasEachValueOfEachCycle) {
    double number = 0.0;
    bool flag = false;
    std::array<std::uint8_t, 11> bytes{};
    FrameRing ring =
        ringOf({{&number, sizeof number}, {&flag, sizeof flag}, {bytes.data(), bytes.size()}});
    for (std::uint64_t i = 0; i < 10; ++i) {
        number = 0.5 * static_cast<double>(i);
        flag = i % 2 == 1;
        bytes.fill(static_cast<std::uint8_t>(i));
        fill(ring, i);
    }
    ASSERT_EQ(ring.end(), 10);
    Frame frame;
    for (std::uint64_t i = 0; i < 10; ++i) {
        ASSERT_TRUE(ring.read(i, frame));
        EXPECT_EQ(frame.cycle().iteration, i);
        EXPECT_EQ(frame.cycle().stamp_ns, static_cast<std::int64_t>(10 * i));
        EXPECT_EQ(frame.cycle().latency_ns, -static_cast<std::int64_t>(i));
        EXPECT_EQ(frame.cycle().duration_ns, static_cast<std::int64_t>(3 * i));
        EXPECT_FALSE(frame.lastOfLoop());
        EXPECT_EQ(valueAt<double>(frame, ring.offset(0)), 0.5 * static_cast<double>(i));
        EXPECT_EQ(valueAt<bool>(frame, ring.offset(1)), i % 2 == 1);
        EXPECT_EQ(valueAt<std::uint8_t>(frame, ring.offset(2) + 10), i);
    }
    EXPECT_FALSE(ring.read(10, frame)) << "the cycle has not run yet";
}

// Each size has its own path: words are gathered, larger or odd sizes are not.
TEST(FrameRing, HasValuesOfAllSizes) {
    constexpr std::size_t kMost = 70;  // bytes
    std::vector<std::vector<std::uint8_t>> values;
    std::vector<FrameRing::Source> sources;
    for (std::size_t size = 1; size <= kMost; ++size) values.emplace_back(size);
    for (const auto& value : values) sources.push_back({value.data(), value.size()});
    FrameRing ring = ringOf(sources);
    std::uint8_t next = 0;
    for (auto& value : values) {
        for (std::uint8_t& byte : value) byte = ++next;
    }
    fill(ring, 0);
    Frame frame;
    ASSERT_TRUE(ring.read(0, frame));
    for (std::size_t i = 0; i < values.size(); ++i) {
        EXPECT_EQ(ring.offset(i) % sizeof(std::uint64_t), 0);
        EXPECT_EQ(std::memcmp(frame.values() + ring.offset(i), values[i].data(), values[i].size()),
                  0)
            << "of " << values[i].size() << " bytes";
        for (std::size_t other = 0; other < i; ++other) {
            EXPECT_TRUE(ring.offset(other) + values[other].size() <= ring.offset(i) ||
                        ring.offset(i) + values[i].size() <= ring.offset(other))
                << other << " and " << i << " bytes lie in each other's place";
        }
    }
}

TEST(FrameRing, KnowsWhichFramesAreOverwritten) {
    double number = 0.0;
    FrameRing ring = ringOf({{&number, sizeof number}});
    ASSERT_EQ(ring.capacity(), 16);
    for (std::uint64_t i = 0; i < 40; ++i) fill(ring, i);
    Frame frame;
    EXPECT_FALSE(ring.read(23, frame));
    ASSERT_TRUE(ring.read(24, frame));
    EXPECT_EQ(frame.cycle().iteration, 24);
}

TEST(FrameRing, KnowsWhichCyclesCount) {
    FrameRing ring = ringOf({});
    for (const FrameKind kind : {FrameKind::WarmUp, FrameKind::Counted, FrameKind::LastOfLoop}) {
        ring.begin({0, 0, 0, 0, 0, kind});
        ring.commit(0);
    }
    Frame frame;
    ASSERT_TRUE(ring.read(0, frame));
    EXPECT_FALSE(frame.counted());
    EXPECT_FALSE(frame.lastOfLoop());
    ASSERT_TRUE(ring.read(1, frame));
    EXPECT_TRUE(frame.counted());
    ASSERT_TRUE(ring.read(2, frame));
    EXPECT_FALSE(frame.counted());
    EXPECT_TRUE(frame.lastOfLoop());
}

TEST(FrameRing, HasTheEndOfEachComponent) {
    const double number = 2.5;
    FrameRing ring({{&number, sizeof number}}, 3, 16, kNsCounter);
    FrameRing::Word* const ended = ring.begin({0, 0, 0, 1, 2});
    for (std::size_t i = 0; i < 3; ++i) ended[i] = 10 * (i + 1);
    ring.take();
    ring.commit(40);
    EXPECT_EQ(ring.lastTicks().ready, 2);
    EXPECT_EQ(ring.lastEnded()[1], 20);
    Frame frame;
    for (const bool values : {true, false}) {
        ASSERT_TRUE(values ? ring.read(0, frame) : ring.readTicks(0, frame));
        EXPECT_EQ(frame.ticks().begin, 1);
        EXPECT_EQ(frame.ticks().ready, 2);
        EXPECT_EQ(frame.ticks().end, 40);
        for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(frame.ended()[i], 10 * (i + 1));
    }
    ASSERT_TRUE(ring.read(0, frame));
    EXPECT_EQ(valueAt<double>(frame, ring.offset(0)), 2.5);
}

TEST(FrameRing, GivesAnOutputThatItsReaderDoesNotKnow) {
    using Reading = FrameRing::Reading;
    Slot<double> slot;
    FrameRing ring = ringOf({{&slot, sizeof slot, sizeof(SlotHeader)}});
    slot.stamp = 7;
    slot.value = 0.5;
    fill(ring, 0);
    ring.begin({1, 20, 0, 0, 0, FrameKind::WarmUp, true});
    ring.take();
    ring.commit(0);
    Slot<double> found;
    std::int64_t stamp_ns = 0;
    EXPECT_EQ(ring.readOutput(0, 0, 7, found, stamp_ns), Reading::Known);
    EXPECT_EQ(ring.readOutput(0, 0, 6, found, stamp_ns), Reading::Copied);
    EXPECT_EQ(found.stamp, 7);
    EXPECT_EQ(found.value, 0.5);
    EXPECT_EQ(ring.readOutput(1, 0, 7, found, stamp_ns), Reading::Copied) << "it was restored";
    EXPECT_EQ(stamp_ns, 20);
    EXPECT_EQ(ring.readOutput(2, 0, 7, found, stamp_ns), Reading::Overwritten) << "it is not there";
    Frame frame;
    ASSERT_TRUE(ring.read(1, frame));
    EXPECT_FALSE(frame.counted());
    EXPECT_FALSE(frame.lastOfLoop());
    EXPECT_EQ(valueAt<double>(frame, ring.offset(0)), 0.5);
}

// As after an update() that throws.
TEST(FrameRing, PutsBackAnOutputWithItsStamp) {
    Slot<double> slot;
    SlotHeader stamp;
    FrameRing ring =
        ringOf({{&slot, sizeof slot, sizeof(SlotHeader)}, {&stamp, sizeof(SlotHeader)}});
    const auto set = [&](std::int64_t time, double value) {
        slot.stamp = stamp.stamp = time;
        slot.value = value;
    };
    set(1, 0.5);
    ring.setBase();
    set(2, 1.5);
    ring.putBack(&slot);
    EXPECT_EQ(slot.stamp, 1);
    EXPECT_EQ(slot.value, 0.5);
    EXPECT_EQ(stamp.stamp, 2);
    set(3, 2.5);
    fill(ring, 0);
    set(4, 3.5);
    ring.putBack(&slot);
    ring.putBack(&stamp);
    EXPECT_EQ(slot.stamp, 3);
    EXPECT_EQ(slot.value, 2.5);
    EXPECT_EQ(stamp.stamp, 3);
}

TEST(FrameRing, AFrameThatHasBegunCannotBeRead) {
    FrameRing ring = ringOf({});
    for (std::uint64_t i = 0; i < ring.capacity(); ++i) fill(ring, i);
    Frame frame;
    ASSERT_TRUE(ring.read(0, frame));
    ring.begin({ring.capacity(), 0, 0, 0, 0});
    EXPECT_FALSE(ring.read(0, frame)) << "it is being overwritten";
    EXPECT_TRUE(ring.read(1, frame));
}

TEST(FrameRing, IsBoundedInBytes) {
    const std::vector<std::uint8_t> large(std::size_t{64} * 1024);
    const FrameRing ring = ringOf({{large.data(), large.size()}}, 50'000);
    EXPECT_LE(ring.capacity() * large.size(), FrameRing::kLargestRing);
    EXPECT_GE(ring.capacity(), FrameRing::kFewestFrames);
}

// All words of a frame are equal; a torn frame would have two different ones.
TEST(FrameRing, NoReaderSeesATornFrame) {
    std::array<std::uint64_t, 32> values{};
    FrameRing ring = ringOf({{values.data(), sizeof values}});
    std::atomic<bool> done{false};
    std::thread writer([&] {
        for (std::uint64_t i = 0; i < kManyFrames; ++i) {
            values.fill(i);
            fill(ring, i);
        }
        done = true;
    });
    Frame frame;
    std::uint64_t whole = 0;
    std::uint64_t next = 0;
    while (!done || next < ring.end()) {
        const std::uint64_t end = ring.end();
        if (end - next > ring.capacity()) next = end - ring.capacity();
        for (; next < end; ++next) {
            if (!ring.read(next, frame)) continue;
            ++whole;
            ASSERT_EQ(frame.cycle().iteration, next);
            for (std::size_t i = 0; i < values.size(); ++i)
                ASSERT_EQ(valueAt<std::uint64_t>(frame, 8 * i), next) << "word " << i;
        }
    }
    writer.join();
    EXPECT_GE(whole, ring.capacity()) << "at least the frames in the ring at the end";
}

}  // namespace
}  // namespace rtcf::test
