#include "ordering/wiring.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "support/graph_fixture.hpp"

namespace rtcf::test {
namespace {

using namespace executor;

constexpr const char* kUnitComponents = RTCF_UNIT_COMPONENTS "/rtcf_unit_test.so";

class WiringTest : public GraphFixture {};

std::vector<std::string> orderOf(const Graph& graph) {
    std::vector<std::string> names;
    for (const std::size_t index : wire(graph, {}, {}).order)
        names.push_back(graph.nodes()[index].instance->fullName());
    return names;
}

TEST_F(WiringTest, OrderOfFig1DoesNotDependOnTheOrderOfLoading) {
    auto instances = fig1();
    std::sort(instances.begin(), instances.end());
    int permutations = 0;
    do {
        EXPECT_EQ(orderOf(graphOf(instances)),
                  (std::vector<std::string>{"/H1", "/F1", "/R1", "/R2", "/R3"}));
        ++permutations;
    } while (std::next_permutation(instances.begin(), instances.end()));
    EXPECT_EQ(permutations, 120);
}

TEST_F(WiringTest, SameMappedNameIsConnected) {
    const Graph graph = graphOf(fig1());
    const Wiring wiring = wire(graph, {}, {});
    const ConnectionPlan& connection = wiring.connections.at("/H1_R1R2");
    EXPECT_EQ(connection.writer->output->name(), "out2");
    EXPECT_EQ(connection.readers.size(), 2U);
    EXPECT_TRUE(wiring.connections.at("/R3_G2H1").readers[0].broken) << "H1 is first";
    EXPECT_FALSE(wiring.connections.at("/R2_R3").readers[0].broken);
}

TEST_F(WiringTest, WhitelistedOutputIsPublishedAndInputWithoutWriterSubscribed) {
    const Graph graph = graphOf(fig1());
    const MappingFilter filter{NamePattern("whitelist", ".*R3_G2H1|.*R1_H1R2|.*G2_R2"), {}};
    const Wiring wiring = wire(graph, filter, {});
    for (const auto& [name, connection] : wiring.connections) {
        EXPECT_EQ(connection.published, name == "/R3_G2H1" || name == "/R1_H1R2") << name;
        EXPECT_EQ(connection.subscribed, name == "/G2_R2") << name;
    }
}

TEST_F(WiringTest, BlacklistOverridesTheWhitelist) {
    const Graph graph = graphOf(fig1());
    const MappingFilter filter{NamePattern("whitelist", ".*"), NamePattern("blacklist", "/R.*")};
    const Wiring wiring = wire(graph, filter, {});
    EXPECT_FALSE(wiring.connections.at("/R2_R3").published);
    EXPECT_TRUE(wiring.connections.at("/H1_F1").published);
}

TEST_F(WiringTest, TwoWritersOfAReadNameAreRejectedByName) {
    const std::string text = errorOf(graphOf(
        {mimo("A", {{"out1", "x"}, {"out2", "a2"}}), mimo("B", {{"out1", "b1"}, {"out2", "x"}}),
         mimo("C", {{"in1", "x"}, {"out1", "c1"}, {"out2", "c2"}})}));
    for (const char* part : {"/x has two writers", "/A.out1", "/B.out2", "/C.in1"}) {
        EXPECT_NE(text.find(part), std::string::npos) << text;
    }
}

TEST_F(WiringTest, SeveralMayWriteAnUnreadNameWithANoteForATopic) {
    const Graph graph = graphOf(
        {mimo("A", {{"out1", "x"}, {"out2", "a2"}}), mimo("B", {{"out1", "b1"}, {"out2", "x"}})});
    EXPECT_TRUE(remarks(graph, wire(graph, {}, {}), {}, {"/B"}).empty());
    const MappingFilter filter{NamePattern("whitelist", "/x"), {}};
    const Wiring wiring = wire(graph, filter, {});
    EXPECT_EQ(wiring.connections.at("/x").others.size(), 1U);
    EXPECT_EQ(
        remarks(graph, wiring, filter, {"/B"}),
        (std::vector<std::string>{"topic /x has 2 writers in this runner: /A.out1, /B.out2"}));
}

TEST_F(WiringTest, DifferentTypesAreRejectedWithBothPortsAndTypes) {
    const std::string text =
        errorOf(graphOf({make(kUnitComponents, "VectorSource", "V", {{"out", "x"}}),
                         mimo("M", {{"in1", "x"}, {"in2", "i2"}, {"in3", "i3"}, {"in4", "i4"}})}));
    for (const char* part : {"/x", "/V.out is Eigen::Vector3d", "/M.in1 is std_msgs/Float64"}) {
        EXPECT_NE(text.find(part), std::string::npos) << text;
    }
}

TEST_F(WiringTest, LoopIsRejectedPortByPortWithCommandsThatBreakIt) {
    auto instances = fig1();
    instances[0] = mimo("H1", {{"in1", "R3_G2H1"}, {"out1", "H1_F1"}, {"out2", "H1_R1R2"}});
    const std::string text = errorOf(graphOf(instances));
    EXPECT_NE(text.find("the connections form a loop: /"), std::string::npos) << text;
    EXPECT_NE(text.find("/R3.out1 → /H1.in1"), std::string::npos) << text;
    EXPECT_NE(text.find("`rtcfctl break"), std::string::npos) << text;
    EXPECT_EQ(text.find('\n'), std::string::npos);
}

TEST_F(WiringTest, LoopThroughAComponentBeingLoadedNamesItsOption) {
    const std::string text =
        errorOf(graphOf({mimo("A", {{"in1", "b"}, {"out1", "a"}, {"out2", "a2"}}),
                         mimo("B", {{"in1", "a"}, {"out1", "b"}, {"out2", "b2"}})}),
                {"/B"});
    EXPECT_NE(text.find("loading B with `--break in1`"), std::string::npos) << text;
    EXPECT_NE(text.find("`rtcfctl break A.in1`"), std::string::npos) << text;
}

TEST_F(WiringTest, LoopInAnAppliedGraphNamesTheKeyOfItsFile) {
    const std::string text =
        errorOf(graphOf({mimo("A", {{"in1", "b"}, {"out1", "a"}, {"out2", "a2"}}),
                         mimo("B", {{"in1", "a"}, {"out1", "b"}, {"out2", "b2"}})}),
                {"", true});
    EXPECT_NE(text.find("`breaks: [in1]` of B"), std::string::npos) << text;
    EXPECT_NE(text.find("`breaks: [in1]` of A"), std::string::npos) << text;
    EXPECT_EQ(text.find("rtcfctl"), std::string::npos) << text;
}

TEST_F(WiringTest, IgnoredConnectionIsALoopBreak) {
    const Graph graph =
        graphOf({mimo("A", {{"in1", "b"}, {"out1", "a"}, {"out2", "a2"}}, false, "/b"),
                 mimo("B", {{"in1", "a"}, {"out1", "b"}, {"out2", "b2"}})});
    EXPECT_EQ(orderOf(graph), (std::vector<std::string>{"/A", "/B"}));
    EXPECT_TRUE(wire(graph, {}, {}).connections.at("/b").readers[0].broken);
}

TEST_F(WiringTest, BreakOfOneInputIsALoopBreak) {
    Graph graph = graphOf({mimo("A", {{"in1", "b"}, {"out1", "a"}, {"out2", "a2"}}),
                           mimo("B", {{"in1", "a"}, {"out1", "b"}, {"out2", "b2"}})});
    EXPECT_NE(errorOf(graph), "");
    graph.setBreak("/B", "in1", true);
    EXPECT_EQ(orderOf(graph), (std::vector<std::string>{"/B", "/A"}));
    graph.setBreak("/B", "in1", false);
    EXPECT_NE(errorOf(graph), "");
}

TEST_F(WiringTest, RemovedBreakOfAFirstComponentKeepsItsOtherBreaks) {
    const auto first = mimo("B", {{"in1", "a"}, {"in2", "a2"}, {"out1", "b"}}, true);
    Graph graph = graphOf({mimo("A", {{"in1", "b"}, {"out1", "a"}, {"out2", "a2"}}), first});
    EXPECT_EQ(orderOf(graph), (std::vector<std::string>{"/B", "/A"}));
    graph.setBreak("/B", "in3", false);
    const LoopBreaks& breaks = graph.get("/B").breaks;
    EXPECT_EQ(breaks.ports, (std::set<std::string>{"in1", "in2", "in4"}));
    EXPECT_FALSE(breaks.first);
    EXPECT_EQ(orderOf(graph), (std::vector<std::string>{"/B", "/A"}));
    graph.setBreak("/B", "in1", false);
    EXPECT_NE(errorOf(graph), "");
    graph.setBreaks("/B", first->definition().breaks);
    EXPECT_TRUE(graph.get("/B").breaks.first);
    EXPECT_EQ(orderOf(graph), (std::vector<std::string>{"/B", "/A"}));
}

TEST_F(WiringTest, RemovedBreakOfAnIgnoredConnectionKeepsTheOtherBreaks) {
    Graph graph = graphOf({mimo("A", {{"in1", "x"}, {"in2", "y"}, {"in3", "z"}}, false, "/x|/y"),
                           mimo("B", {{"out1", "x"}, {"out2", "y"}, {"out3", "z"}})});
    graph.setBreak("/A", "in3", false);  // not a loop break: nothing to do
    EXPECT_EQ(graph.get("/A").breaks.ignore.text(), "/x|/y");
    graph.setBreak("/A", "in1", false);
    EXPECT_EQ(graph.get("/A").breaks.ignore.text(), "");
    EXPECT_EQ(graph.get("/A").breaks.ports, (std::set<std::string>{"in2"}));
    EXPECT_TRUE(graph.get("/A").breaks.include("in2", "/y"));
    EXPECT_FALSE(graph.get("/A").breaks.include("in1", "/x"));
}

TEST_F(WiringTest, ConnectionOfAComponentToItselfIsALoop) {
    Graph graph = graphOf({mimo("A", {{"in1", "x"}, {"out1", "x"}})});
    EXPECT_NE(errorOf(graph).find("/A.out1 → /A.in1"), std::string::npos);
    graph.setBreak("/A", "in1", true);
    EXPECT_EQ(orderOf(graph), std::vector<std::string>{"/A"});
}

TEST_F(WiringTest, BreakOfAMissingPortIsRejected) {
    Graph graph = graphOf({mimo("A", {})});
    try {
        graph.setBreak("/A", "out1", true);
        FAIL() << "no error";
    } catch (const Error& refused) {
        EXPECT_STREQ(refused.what(), "/A has no input out1; it has in1, in2, in3, in4");
    }
}

TEST_F(WiringTest, RemapsOfMissingPortsAreNoted) {
    const auto instance = mimo("A", {{"in1", "x"}, {"speed", "y"}, {"/out1", "z"}});
    EXPECT_EQ(instance->uselessRemaps(), std::vector<std::string>{"speed:=y"});
}

}  // namespace
}  // namespace rtcf::test
