// Memory that is not locked although the process locks all of its memory.
#include "realtime/unlocked_memory.hpp"

#include <gtest/gtest.h>
#include <sys/mman.h>

#include <cstring>
#include <fstream>
#include <string>
#include <vector>

namespace rtcf::test {
namespace {

using executor::UnlockedMemory;
constexpr std::size_t kMega = 1024 * 1024;

std::size_t lockedKb() {
    std::ifstream status("/proc/self/status");
    std::string word;
    while (status >> word) {
        if (word != "VmLck:") continue;
        std::size_t kilo = 0;
        status >> kilo;
        return kilo;
    }
    return 0;
}

TEST(UnlockedMemory, IsUnlockedWhenMappedBeforeOrAfterLocking) {
    UnlockedMemory memory;
    const auto before = memory.allocate(20 * kMega);
    ASSERT_TRUE(before);
    std::memset(before.get(), 1, 20 * kMega);
    if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) GTEST_SKIP() << "needs CAP_IPC_LOCK";
    memory.unlock();
    const std::size_t locked = lockedKb();
    const auto after = memory.allocate(40 * kMega);
    ASSERT_TRUE(after);
    std::memset(after.get(), 1, 40 * kMega);
    EXPECT_LT(lockedKb(), locked + 1024);
    munlockall();
}

TEST(UnlockedMemory, IsReusedAndBounded) {
    UnlockedMemory memory;
    EXPECT_FALSE(memory.allocate(2 * UnlockedMemory::kMost));
    std::vector<std::shared_ptr<std::uint8_t[]>> blocks;
    while (auto block = memory.allocate(kMega)) blocks.push_back(std::move(block));
    EXPECT_EQ(blocks.size(), UnlockedMemory::kMost / kMega);
    EXPECT_EQ(memory.used(), UnlockedMemory::kMost);
    const std::uint8_t* last = blocks.back().get();
    blocks.pop_back();
    EXPECT_EQ(memory.allocate(kMega - 5).get(), last);
    // Freed memory of one size makes room for another.
    blocks.clear();
    EXPECT_EQ(memory.used(), 0U);
    EXPECT_TRUE(memory.allocate(100 * kMega));
}

}  // namespace
}  // namespace rtcf::test
