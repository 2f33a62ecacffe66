#include "statistics/counter.hpp"

#include <gtest/gtest.h>

namespace rtcf::test {
namespace {

TEST(EventCounter, CountsSinceTheLastRestart) {
    executor::EventCounter counter;
    counter.add(3);
    EXPECT_EQ(counter.recent(), 3);
    counter.restart(counter.value());
    EXPECT_EQ(counter.recent(), 0);
    counter.add(2);
    EXPECT_EQ(counter.recent(), 2);
    EXPECT_EQ(counter.value(), 5);
}

}  // namespace
}  // namespace rtcf::test
