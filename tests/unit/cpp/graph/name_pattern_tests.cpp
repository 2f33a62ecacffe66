#include "graph/name_pattern.hpp"

#include <gtest/gtest.h>

#include "refusal.hpp"

namespace rtcf::test {
namespace {

using executor::NamePattern;
using executor::Refusal;

TEST(NamePattern, EmptyMatchesNothing) {
    EXPECT_FALSE(NamePattern().matches(""));
    EXPECT_FALSE(NamePattern("whitelist", "").matches(""));
    EXPECT_FALSE(NamePattern("whitelist", "").matches("/a"));
}

TEST(NamePattern, MustMatchTheWholeName) {
    const NamePattern pattern("whitelist", "/a.*");
    EXPECT_TRUE(pattern.matches("/a"));
    EXPECT_TRUE(pattern.matches("/ab/c"));
    EXPECT_FALSE(pattern.matches("/b/a"));
    EXPECT_FALSE(NamePattern("whitelist", "a").matches("/a"));
}

TEST(NamePattern, TakesThePapersWhitelist) {
    const NamePattern pattern("whitelist", ".*R3_G2H1|.*R1_H1R2|.*G2_R2");
    EXPECT_TRUE(pattern.matches("/R3_G2H1"));
    EXPECT_TRUE(pattern.matches("/ns/G2_R2"));
    EXPECT_FALSE(pattern.matches("/R3_G2H1/more"));
}

// A refusal names what the expression is for, the expression, and what is wrong.
TEST(NamePattern, BadExpressionIsRefusedWithTheReason) {
    const auto refusal = [](const std::string& expression) -> std::string {
        try {
            const NamePattern pattern("ignore of /H1", expression);
            return {};
        } catch (const Refusal& refused) {
            return refused.what();
        }
    };
    for (const char* expression : {"*R3", "(a", "[a", "a{2", "a\\"}) {
        const std::string text = refusal(expression);
        EXPECT_NE(text.find("ignore of /H1"), std::string::npos) << expression;
        EXPECT_NE(text.find(std::string("'") + expression + "'"), std::string::npos) << text;
    }
    EXPECT_NE(refusal("*R3").find("nothing before it"), std::string::npos);
    EXPECT_NE(refusal("(a").find("not closed"), std::string::npos);
}

}  // namespace
}  // namespace rtcf::test
