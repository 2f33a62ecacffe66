#include "names/name_pattern.hpp"

#include <gtest/gtest.h>

#include <string>
#include <thread>

#include "common/error.hpp"
#include "names/names.hpp"

namespace rtcf::test {
namespace {

using executor::Error;
using executor::NamePattern;

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

TEST(NamePattern, AcceptsThePapersWhitelist) {
    const NamePattern pattern("whitelist", ".*R3_G2H1|.*R1_H1R2|.*G2_R2");
    EXPECT_TRUE(pattern.matches("/R3_G2H1"));
    EXPECT_TRUE(pattern.matches("/ns/G2_R2"));
    EXPECT_FALSE(pattern.matches("/R3_G2H1/more"));
}

// An error names the setting, the expression and the reason.
TEST(NamePattern, BadExpressionIsRejectedWithTheReason) {
    const auto errorOf = [](const std::string& expression) -> std::string {
        try {
            const NamePattern pattern("ignore of /H1", expression);
            return {};
        } catch (const Error& refused) {
            return refused.what();
        }
    };
    for (const char* expression : {"*R3", "(a", "[a", "a{2", "a\\"}) {
        const std::string text = errorOf(expression);
        EXPECT_NE(text.find("ignore of /H1"), std::string::npos) << expression;
        EXPECT_NE(text.find(std::string("'") + expression + "'"), std::string::npos) << text;
    }
    EXPECT_NE(errorOf("*R3").find("nothing before it"), std::string::npos);
    EXPECT_NE(errorOf("(a").find("not closed"), std::string::npos);
}

// libstdc++ would recurse once per character, or try all alternatives; the executor's threads have
// small stacks, and the loop waits.
TEST(NamePattern, LongNamesAndHardExpressionsNeedLittleTimeAndStack) {
    const std::string name(executor::kLongestName, 'a');
    std::string hard;
    for (int i = 0; i < 200; ++i) hard += "a?";
    std::string nested = std::string(330, '(') + "a";
    for (int i = 0; i < 330; ++i) nested += ")*";
    std::thread small([&] {
        EXPECT_TRUE(NamePattern("whitelist", nested).matches(name));
        EXPECT_TRUE(NamePattern("whitelist", ".*|(.*a)*").matches(name));
        EXPECT_FALSE(NamePattern("whitelist", hard).matches(name));
    });
    small.join();
}

TEST(NamePattern, TooLongExpressionIsRejected) {
    const std::string longest(executor::kLongestPattern, 'a');
    EXPECT_TRUE(NamePattern("whitelist", longest).matches(longest));
    try {
        const NamePattern pattern("whitelist", longest + "a");
        ADD_FAILURE() << "it was taken";
    } catch (const Error& refused) {
        EXPECT_NE(std::string(refused.what()).find("whitelist"), std::string::npos);
        EXPECT_NE(std::string(refused.what()).find("1001 characters: at most 1000"),
                  std::string::npos)
            << refused.what();
    }
}

}  // namespace
}  // namespace rtcf::test
