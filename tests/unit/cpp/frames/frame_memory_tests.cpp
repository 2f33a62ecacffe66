#include "frames/frame_memory.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "frames/frame_ring.hpp"
#include "realtime/cycle_counter.hpp"

namespace rtcf::executor {
namespace {

// An entry of the file as another process reads it, per ring: sequence, offset of the words,
// frames, words per frame, offset and bytes of the layout.
using Entry = std::array<std::uint64_t, 6>;

std::vector<Entry> entriesOf(const FrameMemory& memory) {
    std::array<Entry, FrameMemory::kRings> all{};
    EXPECT_EQ(::pread(memory.fd(), all.data(), sizeof all, 8), static_cast<ssize_t>(sizeof all));
    std::vector<Entry> found;
    for (const Entry& entry : all) {
        if (entry[0] != 0) found.push_back(entry);
    }
    return found;
}

std::shared_ptr<FrameRing> ringIn(FrameMemory& memory, const double& value,
                                  const std::string& layout) {
    auto ring = std::make_shared<FrameRing>(std::vector<FrameRing::Source>{{&value, sizeof value}},
                                            1, 16, CycleCounter(), &memory);
    if (ring->block() != nullptr)
        memory.announce(ring->block(), ring->capacity(), ring->wordsOfFrame(), layout);
    return ring;
}

TEST(FrameMemory, HasFramesAtTheOffsetsInItsFile) {
    FrameMemory memory;
    double value = 2.5;
    const auto ring = ringIn(memory, value, "layout");
    ring->begin({7, 0, 0, 0, 0});
    ring->take();
    ring->commit(0);
    const std::vector<Entry> entries = entriesOf(memory);
    ASSERT_EQ(entries.size(), 1);
    const auto [sequence, offset, frames, words, layout_offset, layout_bytes] = entries[0];
    EXPECT_EQ(frames, ring->capacity());
    std::vector<std::uint64_t> frame(words);
    ASSERT_GT(::pread(memory.fd(), frame.data(), words * 8, static_cast<off_t>(offset)), 0);
    EXPECT_EQ(frame[0], 2) << "the first frame is complete";
    EXPECT_EQ(frame[1], 7);
    const std::size_t head = words - ring->wordsOfValues();
    EXPECT_EQ(frame[head + ring->offset(0) / 8], 0x4004000000000000) << "2.5";
    std::string layout(layout_bytes, ' ');
    ASSERT_GT(::pread(memory.fd(), layout.data(), layout.size(), static_cast<off_t>(layout_offset)),
              0);
    EXPECT_EQ(layout, "layout");
}

TEST(FrameMemory, KeepsTheRingsOfEarlierGraphs) {
    FrameMemory memory;
    const double value = 0.0;
    for (std::size_t i = 0; i < 3 * FrameMemory::kRings; ++i) (void)ringIn(memory, value, "x");
    const std::vector<Entry> entries = entriesOf(memory);
    ASSERT_EQ(entries.size(), FrameMemory::kRings);
    std::uint64_t newest = 0;
    for (const Entry& entry : entries) {
        newest = std::max(newest, entry[0]);
        EXPECT_GT(entry[0], 2 * FrameMemory::kRings) << "the oldest rings are removed";
    }
    EXPECT_EQ(newest, 3 * FrameMemory::kRings);
}

TEST(FrameMemory, HasRoomAgainAfterRingsWithoutRoomForTheirLayout) {
    FrameMemory memory;
    const double value = 0.0;
    const std::string endless(FrameMemory::kMost + 1, 'x');
    constexpr std::size_t kSmallest = 4096;  // bytes of a block
    for (std::size_t i = 0; i < 2 * FrameMemory::kMost / kSmallest; ++i)
        ASSERT_NE(ringIn(memory, value, endless)->block(), nullptr) << i;
    EXPECT_TRUE(entriesOf(memory).empty()) << "rings without a layout are useless";
    const auto last = ringIn(memory, value, "known");
    EXPECT_EQ(entriesOf(memory).size(), 1U);
}

TEST(FrameMemory, ReusesNoRingThatIsStillRead) {
    FrameMemory memory;
    const double value = 0.0;
    const auto read = ringIn(memory, value, "read");
    const std::uint64_t offset = read->block()->offset();
    for (std::size_t i = 0; i < 3 * FrameMemory::kRings; ++i) {
        const auto other = ringIn(memory, value, "other");
        ASSERT_NE(other->block(), nullptr);
        ASSERT_NE(other->block()->offset(), offset);
    }
}

TEST(FrameMemory, IsBoundedInBytes) {
    FrameMemory memory;
    std::vector<std::shared_ptr<FrameBlock>> held;
    std::size_t bytes = 0;
    for (int i = 0; i < 100; ++i) {
        held.push_back(memory.take(std::size_t{4} * 1024 * 1024));
        if (held.back() != nullptr) bytes += held.back()->bytes();
    }
    EXPECT_LE(bytes, FrameMemory::kMost);
    EXPECT_EQ(held.back(), nullptr) << "the other rings use all of the memory";
    held.pop_back();
}

TEST(FrameMemory, UsesProcessMemoryForARingWithoutRoom) {
    FrameMemory memory;
    std::vector<std::shared_ptr<FrameBlock>> held;
    while (auto block = memory.take(4096)) {
        memory.announce(block, 16, 7, "x");
        held.push_back(std::move(block));
    }
    const double value = 1.0;
    const auto ring = ringIn(memory, value, "x");
    EXPECT_EQ(ring->block(), nullptr);
    ring->begin({3, 0, 0, 0, 0});
    ring->take();
    ring->commit(0);
    Frame frame;
    ASSERT_TRUE(ring->read(0, frame));
    EXPECT_EQ(frame.cycle().iteration, 3);
}

TEST(FrameMemory, ReturnsAClearedBlock) {
    FrameMemory memory;
    const double value = 1.0;
    for (std::size_t i = 0; i < 3 * FrameMemory::kRings; ++i) {
        const auto ring = ringIn(memory, value, "x");
        Frame frame;
        ASSERT_FALSE(ring->read(0, frame)) << "the block has frames of an earlier ring";
        for (std::uint64_t cycle = 0; cycle < 40; ++cycle) {
            ring->begin({cycle, 0, 0, 0, 0});
            ring->take();
            ring->commit(0);
        }
    }
}

}  // namespace
}  // namespace rtcf::executor
