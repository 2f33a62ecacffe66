#include "loop/patience.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <thread>

namespace rtcf::executor {
namespace {

TEST(Patience, EndsAfterItsTime) {
    const std::int64_t begin = monotonicNow();
    Patience patience(kSecond / 20);
    while (patience.wait()) {
    }
    EXPECT_GE(monotonicNow() - begin, kSecond / 20);
}

TEST(Patience, CountsAFreezeAsAMoment) {
    Patience patience(4 * kSecond / 10);
    for (int i = 0; i < 3; ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(200));
        EXPECT_TRUE(patience.wait());
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    EXPECT_FALSE(patience.wait());
}

}  // namespace
}  // namespace rtcf::executor
