// The offset of the wall clock from the loop's clock, measured by reading the clocks one after the
// other, in a thread that may be delayed in between.
#include <gtest/gtest.h>

#include <cstdint>
#include <deque>

#include "realtime/cycle_counter.hpp"

namespace rtcf::test {
namespace {

using executor::realtimeOffset;

constexpr std::int64_t kOffset = 1'700'000'000'000'000'000;  // ns
constexpr std::int64_t kReading = 40;                        // duration of reading a clock, ns
constexpr std::int64_t kHeldUp = 39'000'000;                 // ns

// Two clocks of the same time, which passes while they are read.
struct Time {
    static inline std::int64_t now = 0;
    static inline std::deque<std::int64_t> pauses;  // before each coming reading

    static std::int64_t pass() {
        now += kReading;
        if (!pauses.empty()) {
            now += pauses.front();
            pauses.pop_front();
        }
        return now;
    }
    static std::int64_t monotonic() { return pass(); }
    static std::int64_t realtime() { return pass() + kOffset; }
};

TEST(WallClock, OffsetIsFromTheUndisturbedReading) {
    Time::now = 5'000'000'000;
    // The first reading is delayed between the clocks, the second after them, the third is not, and
    // all following ones are.
    Time::pauses = {0, kHeldUp, 0, 0, 0, kHeldUp, 0, 0, 0};
    for (int i = 0; i < 100; ++i) Time::pauses.insert(Time::pauses.end(), {0, kHeldUp, 0});
    EXPECT_EQ(realtimeOffset(Time::monotonic, Time::realtime), kOffset);
}

TEST(WallClock, OffsetIsBoundedByTheShortestReading) {
    Time::now = 5'000'000'000;
    Time::pauses.clear();
    for (int i = 0; i < 100; ++i)
        Time::pauses.insert(Time::pauses.end(), {0, 1000 * ((i * 5) % 8 + 1), 0});
    const std::int64_t error = realtimeOffset(Time::monotonic, Time::realtime) - kOffset;
    EXPECT_LE(error < 0 ? -error : error, 500) << "half of the shortest pause";
}

}  // namespace
}  // namespace rtcf::test
