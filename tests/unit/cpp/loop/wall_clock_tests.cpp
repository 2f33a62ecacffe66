// How far the wall clock is from the loop's: found by clocks that can only be read one after the
// other, by a thread that others may hold up between the two.
#include <gtest/gtest.h>

#include <cstdint>
#include <deque>

#include "realtime/cycle_counter.hpp"

namespace rtcf::test {
namespace {

using executor::realtimeOffset;

constexpr std::int64_t kOffset = 1'700'000'000'000'000'000;  // ns
constexpr std::int64_t kReading = 40;                        // what reading a clock takes, ns
constexpr std::int64_t kHeldUp = 39'000'000;                 // ns

// Two clocks of one time, which passes as they are read.
struct Time {
    static inline std::int64_t now = 0;
    static inline std::deque<std::int64_t> pauses;  // before each reading to come

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

TEST(WallClock, OffsetIsThatOfTheUndisturbedReading) {
    Time::now = 5'000'000'000;
    // The first is held up between the clocks, the second after them, the third is not, and all
    // that may follow are.
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
