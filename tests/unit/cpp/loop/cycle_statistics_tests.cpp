#include "loop/cycle_statistics.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include "loop/cycle_reader.hpp"

namespace rtcf::test {
namespace {

using namespace executor;

const CycleCounter kCounter;  // one tick takes 1 ns

CycleFrames framesOf(std::size_t components, std::size_t capacity = 16) {
    CycleFrames frames;
    frames.ring = std::make_shared<FrameRing>(std::vector<FrameRing::Source>{}, components,
                                              capacity, kCounter);
    for (std::size_t i = 0; i < components; ++i)
        frames.components.push_back(std::make_shared<ComponentStatistics>());
    return frames;
}

// A cycle whose components take 10, 20, 30 … ticks.
void fill(const CycleFrames& frames, std::uint64_t iteration, FrameKind kind = FrameKind::Counted) {
    FrameRing::Word* const ended = frames.ring->begin({iteration, 0, 7, 1000, 1005, kind});
    std::int64_t now = 1005;
    for (std::size_t i = 0; i < frames.components.size(); ++i) {
        now += static_cast<std::int64_t>(10 * (i + 1));
        ended[i] = static_cast<std::uint64_t>(now);
    }
    frames.ring->commit(now + 2);
}

std::vector<std::uint64_t> allOf(CycleReader& reader) {
    std::vector<std::uint64_t> found;
    Frame frame;
    while (reader.next(frame) != nullptr) found.push_back(frame.cycle().iteration);
    return found;
}

TEST(CycleReader, ReadsEachRingToItsEndBeforeTheNextOne) {
    CycleReader reader;
    const CycleFrames first = framesOf(1);
    const CycleFrames second = framesOf(2);
    reader.follow(first);
    fill(first, 0);
    EXPECT_EQ(allOf(reader), (std::vector<std::uint64_t>{0}));
    fill(first, 1);
    fill(second, 2);
    reader.follow(second);
    fill(second, 3);
    EXPECT_EQ(allOf(reader), (std::vector<std::uint64_t>{1, 2, 3}));
    EXPECT_EQ(reader.lost(), 0U);
}

TEST(CycleReader, GoesOnInARingThatIsUsedAgain) {
    CycleReader reader;
    const CycleFrames frames = framesOf(1);
    reader.follow(frames);
    fill(frames, 0);
    reader.follow(frames);
    fill(frames, 1);
    EXPECT_EQ(allOf(reader), (std::vector<std::uint64_t>{0, 1}));
}

TEST(CycleReader, CountsOverwrittenCycles) {
    CycleReader reader;
    const CycleFrames frames = framesOf(1);
    reader.follow(frames);
    for (std::uint64_t i = 0; i < 40; ++i) fill(frames, i);
    EXPECT_EQ(allOf(reader).size(), 16U);
    EXPECT_EQ(reader.lost(), 24U);
}

TEST(CycleReader, PassesOverCycles) {
    CycleReader reader;
    const CycleFrames first = framesOf(1);
    const CycleFrames second = framesOf(1);
    reader.follow(first);
    fill(first, 0);
    fill(second, 1);
    reader.follow(second);
    reader.skip();
    fill(second, 2);
    EXPECT_EQ(allOf(reader), (std::vector<std::uint64_t>{2}));
    EXPECT_EQ(reader.lost(), 0U);
}

TEST(CycleReader, KeepsNoRingThatHasBeenRead) {
    CycleReader reader;
    CycleFrames first = framesOf(1);
    reader.follow(first);
    fill(first, 0);
    EXPECT_EQ(allOf(reader).size(), 1U);
    const std::weak_ptr<FrameRing> ring = first.ring;
    first.ring.reset();
    reader.follow(framesOf(1));
    EXPECT_TRUE(ring.expired()) << "its memory is free for the next ring";
}

TEST(CycleReader, KeepsFewRingsForAReaderThatIsLate) {
    CycleReader reader;
    std::vector<std::weak_ptr<FrameRing>> rings;
    for (std::uint64_t i = 0; i < 20; ++i) {
        const CycleFrames frames = framesOf(1);
        fill(frames, i);
        reader.follow(frames);
        rings.push_back(frames.ring);
    }
    std::size_t kept = 0;
    for (const auto& ring : rings) kept += ring.expired() ? 0 : 1;
    EXPECT_EQ(kept, CycleReader::kMostRings);
    EXPECT_EQ(allOf(reader).size(), CycleReader::kMostRings);
    EXPECT_EQ(reader.lost(), 20U - CycleReader::kMostRings);
}

TEST(CycleStatistics, HaveTheDurationsOfTheLoopAndOfEachComponent) {
    LoopStatistics loop;
    CycleStatistics statistics(loop);
    const CycleFrames frames = framesOf(3);
    statistics.follow(frames);
    for (std::uint64_t i = 0; i < 5; ++i) fill(frames, i);
    EXPECT_DOUBLE_EQ(statistics.count(), 5.0 / 16.0);
    const HistogramSnapshot duration = statistics.duration().snapshot();
    EXPECT_EQ(duration.count, 5U);
    EXPECT_EQ(duration.maximum, 5 + 10 + 20 + 30 + 2);
    EXPECT_EQ(statistics.latency().snapshot().maximum, 7);
    for (std::size_t i = 0; i < 3; ++i) {
        const HistogramSnapshot component = frames.components[i]->duration.snapshot();
        EXPECT_EQ(component.count, 5U);
        EXPECT_EQ(component.sum, static_cast<std::int64_t>(5 * 10 * (i + 1)));
    }
}

TEST(CycleStatistics, LeaveOutAComponentThatDidNotRun) {
    LoopStatistics loop;
    CycleStatistics statistics(loop);
    const CycleFrames frames = framesOf(3);
    statistics.follow(frames);
    FrameRing::Word* const ended = frames.ring->begin({0, 0, 0, 0, 5});
    ended[0] = 15;
    ended[1] = 0;
    ended[2] = 22;
    frames.ring->commit(30);
    statistics.count();
    EXPECT_EQ(frames.components[0]->duration.snapshot().sum, 10);
    EXPECT_EQ(frames.components[1]->duration.snapshot().count, 0U);
    EXPECT_EQ(frames.components[2]->duration.snapshot().sum, 7);
}

TEST(CycleStatistics, LeaveOutTheWarmUpAndTheLastCycle) {
    LoopStatistics loop;
    CycleStatistics statistics(loop);
    const CycleFrames frames = framesOf(1);
    statistics.follow(frames);
    fill(frames, 0, FrameKind::WarmUp);
    fill(frames, 1);
    fill(frames, 2, FrameKind::LastOfLoop);
    statistics.count();
    EXPECT_EQ(statistics.duration().snapshot().count, 1U);
    EXPECT_EQ(frames.components[0]->duration.snapshot().count, 1U);
}

TEST(CycleStatistics, RestartedCountLaterCycles) {
    LoopStatistics loop;
    CycleStatistics statistics(loop);
    const CycleFrames frames = framesOf(1);
    statistics.follow(frames);
    for (std::uint64_t i = 0; i < 40; ++i) fill(frames, i);
    frames.components[0]->overruns.add(2);
    frames.components[0]->device.calls = 4;
    EXPECT_GT(statistics.count(), 1.0) << "more than the ring holds";
    EXPECT_EQ(statistics.lost(), 24U);
    fill(frames, 40);
    statistics.restart();
    EXPECT_EQ(statistics.lost(), 0U);
    fill(frames, 41);
    statistics.count();
    EXPECT_EQ(statistics.duration().snapshot().count, 1U);
    EXPECT_EQ(statistics.latency().snapshot().count, 1U);
    EXPECT_EQ(frames.components[0]->duration.snapshot().count, 1U);
    EXPECT_EQ(frames.components[0]->overruns.recent(), 0U);
    EXPECT_EQ(frames.components[0]->device_before.calls, 4U);
}

TEST(CycleStatistics, FollowAGraphOfOtherComponents) {
    LoopStatistics loop;
    CycleStatistics statistics(loop);
    const CycleFrames first = framesOf(2);
    const CycleFrames second = framesOf(1);
    statistics.follow(first);
    fill(first, 0);
    fill(second, 1);
    statistics.follow(second);
    statistics.count();
    EXPECT_EQ(statistics.duration().snapshot().count, 2U);
    EXPECT_EQ(first.components[1]->duration.snapshot().count, 1U);
    EXPECT_EQ(second.components[0]->duration.snapshot().count, 1U);
}

TEST(CycleStatistics, RestartTheCountersOfTheLoop) {
    LoopStatistics loop;
    CycleStatistics statistics(loop);
    loop.overruns.add(3);
    loop.late_wake_ups.add(3);
    statistics.restart();
    EXPECT_EQ(loop.overruns.recent(), 0U);
    EXPECT_EQ(loop.late_wake_ups.recent(), 0U);
    EXPECT_EQ(loop.overruns.value(), 3U);
}

// A cycle that is late changes counters after its frame.
class LateCycles : public ::testing::Test {
   protected:
    LateCycles() { statistics_.follow(frames_); }

    void end() {
        fill(frames_, 0);
        loop_.overruns.add(1);
        frames_.components[0]->overruns.add(1);
        frames_.ring->settle();
    }
    // Durations and counters that are read while `meanwhile` happens once.
    template <typename Meanwhile>
    std::array<std::uint64_t, 3> readWhile(Meanwhile meanwhile) {
        bool happened = false;
        std::array<std::uint64_t, 3> found{};
        statistics_.read(
            [&] {
                found[0] = loop_.overruns.recent();
                if (!std::exchange(happened, true)) meanwhile();
                found[1] = frames_.components[0]->overruns.recent();
            },
            [&] { found[2] = statistics_.duration().snapshot().count; });
        return found;
    }

    LoopStatistics loop_;
    CycleStatistics statistics_{loop_};
    CycleFrames frames_ = framesOf(1);
};

TEST_F(LateCycles, CountersAndDurationsAreOfTheSameCycles) {
    end();
    EXPECT_EQ(readWhile([] {}), (std::array<std::uint64_t, 3>{1, 1, 1}));
    EXPECT_EQ(readWhile([this] { end(); }), (std::array<std::uint64_t, 3>{2, 2, 2}));
    statistics_.restart();
    EXPECT_EQ(readWhile([] {}), (std::array<std::uint64_t, 3>{0, 0, 0}));
    EXPECT_EQ(readWhile([this] { end(); }), (std::array<std::uint64_t, 3>{1, 1, 1}));
}

// For example, a debugger stops the loop at the worst moment.
TEST_F(LateCycles, ALoopThatIsNeverSettledIsReadAnyway) {
    end();
    fill(frames_, 1);
    loop_.overruns.add(1);
    EXPECT_EQ(readWhile([] {}), (std::array<std::uint64_t, 3>{2, 1, 2}));
}

// Cycles that no counting can follow are lost, but counting ends.
TEST(CycleStatistics, CountEachCycleOrItsLoss) {
    constexpr std::uint64_t kCycles = 100'000;
    LoopStatistics loop;
    CycleStatistics statistics(loop);
    const CycleFrames frames = framesOf(2, 64);
    statistics.follow(frames);
    std::atomic<bool> done{false};
    std::thread thread([&] {
        for (std::uint64_t i = 0; i < kCycles; ++i) fill(frames, i);
        done = true;
    });
    while (!done) statistics.count();
    thread.join();
    statistics.count();
    const HistogramSnapshot duration = statistics.duration().snapshot();
    EXPECT_EQ(duration.count + statistics.lost(), kCycles);
    EXPECT_EQ(duration.sum, static_cast<std::int64_t>(duration.count * (5 + 10 + 20 + 2)));
    EXPECT_EQ(frames.components[1]->duration.snapshot().count, duration.count);
}

}  // namespace
}  // namespace rtcf::test
