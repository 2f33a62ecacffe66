#include <gtest/gtest.h>

#include "ros/roscpp/node_name.hpp"

using rtcf::ros1::nodeName;
using rtcf::ros1::nodeNameOf;

TEST(NodeName, ContainsHostAndRunner) {
    EXPECT_EQ(nodeName("robot", "", "arm").full(), "/rtcfd/robot/arm");
}

TEST(NodeName, OfAPrivateDaemonDiffersFromTheSystems) {
    EXPECT_EQ(nodeName("robot", "eve-3f", "arm").full(), "/rtcfd/robot/eve_3f/arm");
}

TEST(NodeName, ReplacesCharactersInvalidInRos) {
    EXPECT_EQ(nodeName("pi-4.lab.example", "", "left arm/2").full(),
              "/rtcfd/pi_4_lab_example/left_arm_2");
}

TEST(NodeName, IsTheGivenNamespaceOfARunner) {
    const auto own = nodeName("robot", "", "arm");
    EXPECT_EQ(nodeNameOf("/rt_runner", own).full(), "/rt_runner");
    EXPECT_EQ(nodeNameOf("/rt_runner", own).name_space, "");
    EXPECT_EQ(nodeNameOf("/arm/left/rt_runner", own).full(), "/arm/left/rt_runner");
    EXPECT_EQ(nodeNameOf("/arm/left/rt_runner", own).name_space, "/arm/left");
    EXPECT_EQ(nodeNameOf("", own).full(), own.full());
    EXPECT_EQ(nodeNameOf("/", own).full(), own.full());
}

TEST(NodeName, HasAReplacementForEmptyParts) {
    EXPECT_EQ(nodeName("", "", "").full(), "/rtcfd/localhost/rt_runner");
}
