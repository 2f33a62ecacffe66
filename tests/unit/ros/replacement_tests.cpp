#include <gtest/gtest.h>

#include "ros/roscpp/replacements.hpp"

using rtcf::ros1::broken;
using rtcf::ros1::Dependence;

TEST(Replacements, AreInPlaceWithTheRoscppOfThisMachine) {
    EXPECT_EQ(broken(rtcf::ros1::dependences()), std::vector<std::string>{});
}

TEST(Replacements, ThatALibraryDoesNotHaveAreTold) {
    const std::vector<Dependence> other{
        {Dependence::Kind::Function, "_ZN3ros6master6nobodyEv", "libroscpp.so", "the first use"},
        {Dependence::Kind::Text, "no such text there is", "libroscpp.so", "the second use"}};
    const std::vector<std::string> lines = broken(other);
    ASSERT_EQ(lines.size(), 2U);
    EXPECT_NE(lines[0].find("the first use"), std::string::npos);
    EXPECT_NE(lines[1].find("no such text there is"), std::string::npos);
}
