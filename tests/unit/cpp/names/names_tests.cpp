#include "names/names.hpp"

#include <gtest/gtest.h>

#include <functional>

#include "common/error.hpp"

namespace rtcf::test {
namespace {

using namespace executor;

TEST(Names, RelativeOnesResolveInTheNamespace) {
    EXPECT_EQ(resolveName("bar", "/", "/node1"), "/bar");
    EXPECT_EQ(resolveName("bar", "/wg", "/wg/node2"), "/wg/bar");
    EXPECT_EQ(resolveName("foo/bar", "/wg", "/wg/node3"), "/wg/foo/bar");
}

TEST(Names, AbsoluteOnesStayUnchanged) {
    EXPECT_EQ(resolveName("/bar", "/", "/node1"), "/bar");
    EXPECT_EQ(resolveName("/bar", "/wg", "/wg/node2"), "/bar");
}

TEST(Names, PrivateOnesResolveBelowTheComponent) {
    EXPECT_EQ(resolveName("~bar", "/", "/node1"), "/node1/bar");
    EXPECT_EQ(resolveName("~foo/bar", "/wg", "/wg/node3"), "/wg/node3/foo/bar");
    EXPECT_EQ(resolveName("~/bar", "/wg", "/wg/node3"), "/wg/node3/bar");
}

TEST(Names, DoubledAndTrailingSlashesAreRemoved) {
    EXPECT_EQ(resolveName("//a//b/", "/", "/n"), "/a/b");
    EXPECT_EQ(canonicalNamespace("arm//left/"), "/arm/left");
    EXPECT_EQ(canonicalNamespace(""), "/");
    EXPECT_EQ(canonicalNamespace("/"), "/");
}

TEST(Names, AreLegalAsInRos) {
    for (const char* name : {"a", "/a", "~a", "a/b", "a_1", "/", "~"})
        EXPECT_TRUE(isGraphName(name)) << name;
    for (const char* name : {"", "1a", "a-b", "a b", "a~", "_a", "a.b", "ä"})
        EXPECT_FALSE(isGraphName(name)) << name;
}

TEST(Names, BaseNamesHaveNoSlashes) {
    for (const char* name : {"a", "H1", "left_arm"}) EXPECT_TRUE(isBaseName(name)) << name;
    for (const char* name : {"", "/a", "a/b", "~a", "1a", "_a", "a-b"})
        EXPECT_FALSE(isBaseName(name)) << name;
}

TEST(Names, InvalidNamespaceIsRejected) {
    for (const char* ns : {"~arm", "left arm", "/a-b"})
        EXPECT_THROW(canonicalNamespace(ns), Error) << ns;
}

TEST(Names, ComponentsResolveInTheRoot) {
    EXPECT_EQ(fullNameOf("H1"), "/H1");
    EXPECT_EQ(fullNameOf("arm/H1"), "/arm/H1");
    EXPECT_EQ(fullNameOf("/arm//H1/"), "/arm/H1");
    for (const char* name : {"", "~H1", "H 1"}) EXPECT_THROW(fullNameOf(name), Error) << name;
}

TEST(Names, ThatAreTooLongAreRejectedWithTheirLength) {
    const std::string longest(kLongestName, 'a');
    EXPECT_EQ(fullNameOf("/" + longest.substr(1)).size(), kLongestName);
    for (const auto& refuse : {std::function<void()>([&] { fullNameOf(longest + "a"); }),
                               std::function<void()>([&] { canonicalNamespace(longest + "a"); })}) {
        try {
            refuse();
            ADD_FAILURE() << "it was taken";
        } catch (const Error& refused) {
            EXPECT_NE(std::string(refused.what()).find("256 characters: at most 255"),
                      std::string::npos)
                << refused.what();
            EXPECT_LT(std::string(refused.what()).size(), 150U);
        }
    }
}

TEST(MappedName, WithoutRemapIsResolved) {
    EXPECT_EQ(mappedName("in", "/arm", "/arm/pid", {}), "/arm/in");
}

TEST(MappedName, RemapIsResolvedOnBothSides) {
    EXPECT_EQ(mappedName("in", "/arm", "/arm/pid", {{"in", "speed"}}), "/arm/speed");
    EXPECT_EQ(mappedName("in", "/arm", "/arm/pid", {{"/arm/in", "/speed"}}), "/speed");
    EXPECT_EQ(mappedName("in", "/arm", "/arm/pid", {{"in", "~speed"}}), "/arm/pid/speed");
    EXPECT_EQ(mappedName("in", "/arm", "/arm/pid", {{"in", "left/speed"}}), "/arm/left/speed");
}

TEST(MappedName, RemapOfAnotherNameIsIgnored) {
    EXPECT_EQ(mappedName("in", "/arm", "/arm/pid", {{"in1", "speed"}, {"/in", "/x"}, {"~in", "y"}}),
              "/arm/in");
}

TEST(MappedName, RemapsDoNotChain) {
    EXPECT_EQ(mappedName("in", "/", "/pid", {{"in", "a"}, {"a", "b"}}), "/a");
}

TEST(MappedName, LaterRemapOfTheSameNameWins) {
    EXPECT_EQ(mappedName("in", "/", "/pid", {{"in", "a"}, {"/in", "b"}}), "/b");
}

}  // namespace
}  // namespace rtcf::test
