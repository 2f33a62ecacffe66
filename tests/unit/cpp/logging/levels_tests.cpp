#include "logging/levels.hpp"

#include <gtest/gtest.h>

namespace rtcf::test {
namespace {

using executor::LogLevels;

TEST(LogLevels, NameALoggerAfterItsComponent) {
    EXPECT_EQ(LogLevels::loggerOf("/arm/H1"), "ros.rtcf.arm.H1");
    EXPECT_EQ(LogLevels::loggerOf(""), "ros.rtcf");
}

TEST(LogLevels, AreTheNearestAncestors) {
    LogLevels levels;
    EXPECT_EQ(levels.of("ros.rtcf.arm.H1"), LogLevel::Info);
    levels.set("ros.rtcf.arm", LogLevel::Error);
    EXPECT_EQ(levels.of("ros.rtcf.arm.H1"), LogLevel::Error);
    EXPECT_EQ(levels.of("ros.rtcf.armature"), LogLevel::Info);
    levels.set("ros.rtcf.arm.H1", LogLevel::Debug);
    EXPECT_EQ(levels.of("ros.rtcf.arm.H1"), LogLevel::Debug);
    EXPECT_EQ(levels.of("ros.rtcf.arm.F1"), LogLevel::Error);
    levels.set("ros", LogLevel::Warn);
    EXPECT_EQ(levels.of("ros.roscpp"), LogLevel::Warn);
    EXPECT_EQ(levels.of("elsewhere"), LogLevel::Warn);
}

TEST(LogLevels, ApplyToRtcf2021sNames) {
    LogLevels levels;
    levels.set("ros.rtcf./arm/H1", LogLevel::Debug);
    EXPECT_EQ(levels.of("ros.rtcf.arm.H1"), LogLevel::Debug);
    levels.set("ros.rtcf.arm.H1", LogLevel::Error);
    EXPECT_EQ(levels.of("ros.rtcf./arm/H1"), LogLevel::Error);
    EXPECT_EQ(levels.all().count("ros.rtcf./arm/H1"), 0U);
}

TEST(LogLevels, ApplyImmediately) {
    LogLevels levels;
    std::atomic<LogLevel> one{LogLevel::Fatal};
    std::atomic<LogLevel> other{LogLevel::Fatal};
    levels.attach("/one", one);
    levels.attach("/other", other);
    EXPECT_EQ(one, LogLevel::Info);
    levels.set("ros.rtcf.one", LogLevel::Debug);
    EXPECT_EQ(one, LogLevel::Debug);
    EXPECT_EQ(other, LogLevel::Info);
    EXPECT_EQ(levels.lowest(), LogLevel::Debug);
    levels.detach(one);
    levels.set("ros.rtcf", LogLevel::Error);
    levels.set("ros.rtcf.one", LogLevel::Fatal);
    EXPECT_EQ(one, LogLevel::Debug);
    EXPECT_EQ(other, LogLevel::Error);
    // A later component gets the level that was set before.
    levels.attach("/one", one);
    EXPECT_EQ(one, LogLevel::Fatal);
    levels.detach(one);
    levels.detach(other);
}

TEST(LogLevels, ListAllNamedLoggers) {
    LogLevels levels;
    std::atomic<LogLevel> level{LogLevel::Info};
    levels.attach("/H1", level);
    levels.know("ros.roscpp");
    levels.set("ros.rtcf", LogLevel::Warn);
    const std::map<std::string, LogLevel> expected{{"ros", LogLevel::Info},
                                                   {"ros.roscpp", LogLevel::Info},
                                                   {"ros.rtcf", LogLevel::Warn},
                                                   {"ros.rtcf.H1", LogLevel::Warn}};
    EXPECT_EQ(levels.all(), expected);
    levels.detach(level);
}

}  // namespace
}  // namespace rtcf::test
