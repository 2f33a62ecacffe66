#include <gtest/gtest.h>

#include "ros/transport/raw_message.hpp"

using rtcf::ros1::startsWithHeader;

TEST(RawMessage, FindsAHeaderInFront) {
    EXPECT_TRUE(startsWithHeader("Header header\nfloat64 x\n"));
    EXPECT_TRUE(
        startsWithHeader("# comment = here\n\nuint8 A=1\n  std_msgs/Header  header # stamp\n"));
}

TEST(RawMessage, FindsNoHeaderElsewhere) {
    EXPECT_FALSE(startsWithHeader(""));
    EXPECT_FALSE(startsWithHeader("float64 x\nHeader header\n"));
    EXPECT_FALSE(startsWithHeader("Header other\n"));
    EXPECT_FALSE(startsWithHeader("====\nMSG: std_msgs/Header\nHeader header\n"));
}
