#include "watch/port_selection.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "common/error.hpp"

namespace rtcf::test {
namespace {

using executor::Error;
using executor::PortSelection;

bool selects(const std::string& pattern, const std::string& name) {
    return PortSelection({pattern}).matches(name);
}

TEST(PortSelection, WithoutPatternsIsEverything) {
    EXPECT_TRUE(PortSelection({}).matches("/arm/pid.effort"));
}

TEST(PortSelection, NamesOnePort) {
    EXPECT_TRUE(selects("/arm/pid.effort", "/arm/pid.effort"));
    EXPECT_TRUE(selects("arm/pid.effort", "/arm/pid.effort"));
    EXPECT_FALSE(selects("/arm/pid.effort", "/arm/pid.efforts"));
    EXPECT_FALSE(selects("/arm/pid.effort", "/arm/pid2.effort"));
}

TEST(PortSelection, OfAComponentIsAllItsPorts) {
    EXPECT_TRUE(selects("pid", "/pid.effort"));
    EXPECT_TRUE(selects("/arm/pid", "/arm/pid.integral"));
    EXPECT_FALSE(selects("pid", "/arm/pid.effort"));
    EXPECT_FALSE(selects("pid", "/pid2.effort"));
}

TEST(PortSelection, OneStarStopsAtASlashTwoDoNot) {
    EXPECT_TRUE(selects("/arm/*.effort", "/arm/pid.effort"));
    EXPECT_FALSE(selects("/arm/*.effort", "/arm/left/pid.effort"));
    EXPECT_TRUE(selects("/arm/**.effort", "/arm/left/pid.effort"));
    EXPECT_TRUE(selects("**.effort", "/arm/left/pid.effort"));
    EXPECT_TRUE(selects("/*/*.e*t", "/arm/pid.effort"));
    EXPECT_TRUE(selects("/arm*", "/arm1.x"));
}

TEST(PortSelection, AcceptsSingleCharactersAndSets) {
    EXPECT_TRUE(selects("/joint?.out", "/joint3.out"));
    EXPECT_FALSE(selects("/joint?.out", "/joint13.out"));
    EXPECT_FALSE(selects("/arm?pid.out", "/arm/pid.out"));
    EXPECT_TRUE(selects("/joint[135].out", "/joint3.out"));
    EXPECT_FALSE(selects("/joint[135].out", "/joint2.out"));
    EXPECT_TRUE(selects("/joint[1-4].out", "/joint2.out"));
    EXPECT_FALSE(selects("/joint[1-4].out", "/joint5.out"));
    EXPECT_TRUE(selects("/joint[1.out", "/joint[1.out")) << "an unclosed bracket is literal";
}

TEST(PortSelection, ConsecutiveStarsAreOne) {
    EXPECT_TRUE(selects("/arm" + std::string(900, '*') + ".out", "/arm/joint/pid.out"));
    EXPECT_TRUE(selects("/***.out", "/arm/pid.out"));
    EXPECT_FALSE(selects("/arm" + std::string(900, '*') + ".out", "/leg/pid.out"));
}

TEST(PortSelection, HardPatternsAreFast) {
    std::string pattern = "/";
    for (int i = 0; i < 300; ++i) pattern += "*a";
    EXPECT_FALSE(selects(pattern, "/" + std::string(250, 'a') + ".b"));
}

TEST(PortSelection, AcceptsNamesAndPatternsTogether) {
    const PortSelection selection({"arm/pid.effort", "/leg/*.out", "/arm/pid.error"});
    EXPECT_TRUE(selection.matches("/arm/pid.effort"));
    EXPECT_TRUE(selection.matches("/arm/pid.error"));
    EXPECT_TRUE(selection.matches("/leg/pid.out"));
    EXPECT_FALSE(selection.matches("/arm/pid.integral"));
    EXPECT_FALSE(selection.matches("/leg/pid.in"));
    ASSERT_EQ(selection.patterns().size(), 3U);
    EXPECT_EQ(selection.patterns()[0].given(), "arm/pid.effort");
    EXPECT_EQ(selection.patterns()[0].name(), "/arm/pid.effort");
    EXPECT_TRUE(selection.patterns()[1].name().empty());
    EXPECT_EQ(selection.rank("/arm/pid.error"), 2U);
    EXPECT_EQ(selection.rank("/leg/pid.out"), 1U);
    EXPECT_EQ(selection.rank("/leg/pid.in"), PortSelection::kNone);
    EXPECT_LT(selection.rank("/arm/pid.error"), PortSelection({}).rank("/arm/pid.error"));
    EXPECT_EQ(PortSelection({"a.b", "a.*", "a.c"}).rank("/a.c"), 1U) << "the first that matches";
}

TEST(PortSelection, RejectsEmptyAndTooLongPatterns) {
    EXPECT_THROW(PortSelection({""}), Error);
    EXPECT_THROW(PortSelection({std::string(2000, 'a')}), Error);
}

}  // namespace
}  // namespace rtcf::test
