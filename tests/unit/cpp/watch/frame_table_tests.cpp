// The time span that a loop's frames hold, and the note for a short one.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "support/runner_fixture.hpp"

namespace rtcf::test {
namespace {

constexpr std::size_t kMega = std::size_t{1024} * 1024;

class FrameTables : public RunnerFixture {
   protected:
    void keep(std::size_t bytes) {
        configure([bytes](RunnerSettings& settings) { settings.frame_bytes = bytes; });
    }
    std::vector<std::string> warnings() {
        std::vector<std::string> found;
        for (const LogEntry& entry : logged()) {
            if (entry.level == LogLevel::Warn && entry.message.find("frames hold") == 0)
                found.push_back(entry.message);
        }
        return found;
    }
};

TEST_F(FrameTables, HoldingLessThanASecondAreReported) {
    load(definition("Ticker", "T"));
    EXPECT_TRUE(warnings().empty());
    keep(kMega);
    EXPECT_TRUE(warnings().empty());
    load(definition("Camera", "C"));
    ASSERT_EQ(warnings().size(), 1U);
    EXPECT_EQ(warnings()[0],
              "frames hold the last 16 cycles (0.016 s), not one second: each takes 1024.1 KiB, "
              "and the ring is limited to 16 MiB: lower frame_kb of the runner, or "
              "watch fewer values");
    load(definition("Chatter", "D"));
    EXPECT_EQ(warnings().size(), 1U) << "no further warning";
    keep(kMega / 16);
    EXPECT_EQ(warnings().size(), 1U);
    keep(kMega);
    EXPECT_EQ(warnings().size(), 2U) << "a new warning";
}

TEST_F(FrameTables, HoldingASecondOfASlowLoopAreNotReported) {
    configure([](RunnerSettings& settings) { settings.frequency_hz = 16.0; });
    keep(kMega);
    load(definition("Camera", "C"));
    EXPECT_TRUE(warnings().empty());
}

}  // namespace
}  // namespace rtcf::test
