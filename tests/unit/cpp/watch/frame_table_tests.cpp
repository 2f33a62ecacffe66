// How long a time the frames of a loop hold, and who is told if it is not long.
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

TEST_F(FrameTables, ThatHoldLessThanASecondAreTold) {
    load(definition("Ticker", "T"));
    EXPECT_TRUE(warnings().empty());
    keep(kMega);
    EXPECT_TRUE(warnings().empty());
    load(definition("Camera", "C"));
    ASSERT_EQ(warnings().size(), 1U);
    EXPECT_EQ(warnings()[0],
              "frames hold the last 16 cycles (0.016 s), not one second: each has 1024.0 KiB of "
              "values, and the ring is limited to 16 MiB: lower frame_kb of the runner, or "
              "watch fewer values");
    load(definition("Chatter", "D"));
    EXPECT_EQ(warnings().size(), 1U) << "it is as it was";
    keep(kMega / 16);
    EXPECT_EQ(warnings().size(), 1U);
    keep(kMega);
    EXPECT_EQ(warnings().size(), 2U) << "anew";
}

TEST_F(FrameTables, ThatHoldASecondOfASlowLoopAreNotTold) {
    configure([](RunnerSettings& settings) { settings.frequency_hz = 16.0; });
    keep(kMega);
    load(definition("Camera", "C"));
    EXPECT_TRUE(warnings().empty());
}

}  // namespace
}  // namespace rtcf::test
