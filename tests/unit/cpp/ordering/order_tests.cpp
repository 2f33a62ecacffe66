#include "ordering/order.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <numeric>

#include "ordering/digraphs.hpp"

namespace rtcf::test {
namespace {

using executor::Edge;
using executor::findOrder;
using executor::OrderProblem;
using executor::OrderResult;

// Fig. 1 of the paper; H1 is first, so its inputs are loop breaks and no edges.
const std::vector<std::string> kNames{"/H1", "/F1", "/R1", "/R2", "/R3"};
const std::vector<Edge> kEdges{{0, 1, "out1", "in1"}, {0, 2, "out2", "in1"}, {0, 3, "out2", "in2"},
                               {1, 3, "out1", "in1"}, {1, 4, "out1", "in1"}, {2, 3, "out1", "in3"},
                               {3, 4, "out1", "in2"}};

std::vector<std::string> namesInOrder(const OrderProblem& problem) {
    std::vector<std::string> names;
    for (const std::size_t index : findOrder(problem).order) names.push_back(problem.names[index]);
    return names;
}

TEST(Order, OfFig1DoesNotDependOnTheOrderOfLoading) {
    std::array<std::size_t, 5> place{0, 1, 2, 3, 4};
    int permutations = 0;
    do {
        OrderProblem problem{std::vector<std::string>(5), std::vector<bool>(5, false), {}};
        for (std::size_t i = 0; i < 5; ++i) {
            problem.names[place[i]] = kNames[i];
            problem.first[place[i]] = i == 0;
        }
        for (Edge edge : kEdges) {
            edge.from = place[edge.from];
            edge.to = place[edge.to];
            problem.edges.push_back(edge);
        }
        EXPECT_EQ(namesInOrder(problem), kNames);
        ++permutations;
    } while (std::next_permutation(place.begin(), place.end()));
    EXPECT_EQ(permutations, 120);
}

TEST(Order, OfUnconnectedComponentsIsByName) {
    const OrderProblem problem{{"/b", "/a/z", "/a"}, {false, false, false}, {}};
    EXPECT_EQ(namesInOrder(problem), (std::vector<std::string>{"/a", "/a/z", "/b"}));
}

TEST(Order, PutsReadyFirstComponentsBeforeOthers) {
    const OrderProblem problem{{"/a", "/b", "/z"}, {false, false, true}, {}};
    EXPECT_EQ(namesInOrder(problem), (std::vector<std::string>{"/z", "/a", "/b"}));
}

TEST(Order, OfAnEmptyGraphIsEmpty) {
    const OrderResult result = findOrder({});
    EXPECT_TRUE(result.orderable());
    EXPECT_TRUE(result.order.empty());
}

TEST(Order, CountsParallelConnections) {
    const OrderProblem problem{
        {"/a", "/b"}, {false, false}, {{1, 0, "o", "i"}, {1, 0, "o", "j"}, {1, 0, "p", "k"}}};
    EXPECT_EQ(namesInOrder(problem), (std::vector<std::string>{"/b", "/a"}));
}

OrderProblem problemOf(Digraph graph, unsigned nodes) {
    static const std::array<std::string, 5> kNodes{"/a", "/b", "/c", "/d", "/e"};
    OrderProblem problem;
    for (unsigned from = 0; from < nodes; ++from) {
        problem.names.push_back(kNodes[from]);
        problem.first.push_back(false);
        for (unsigned to = 0; to < nodes; ++to) {
            if (hasEdge(graph, from, to))
                problem.edges.push_back({from, to, "out", "in" + std::to_string(from)});
        }
    }
    return problem;
}

bool sameEdge(const Edge& a, const Edge& b) {
    return a.from == b.from && a.to == b.to && a.from_port == b.from_port && a.to_port == b.to_port;
}

bool contains(const std::vector<Edge>& edges, const Edge& wanted) {
    return std::any_of(edges.begin(), edges.end(),
                       [&](const Edge& edge) { return sameEdge(edge, wanted); });
}

// The reason why it is not a loop; empty = it is one.
std::string flawOfLoop(const OrderProblem& problem, const std::vector<Edge>& loop) {
    if (loop.empty()) return "no loop";
    for (std::size_t i = 0; i < loop.size(); ++i) {
        if (!contains(problem.edges, loop[i])) return "an edge that is not in the graph";
        if (loop[i].to != loop[(i + 1) % loop.size()].from) return "edges that do not chain";
    }
    return {};
}

std::string flawOfCuts(const OrderProblem& problem, const OrderResult& result) {
    if (result.cuts.size() != result.loop.size()) return "not one cut for each edge of the loop";
    for (std::size_t i = 0; i < result.cuts.size(); ++i) {
        if (!contains(result.cuts[i], result.loop[i])) return "a cut without its edge";
        OrderProblem cut = problem;
        for (const Edge& edge : result.cuts[i]) {
            const auto gone =
                std::remove_if(cut.edges.begin(), cut.edges.end(),
                               [&](const Edge& other) { return sameEdge(edge, other); });
            if (gone == cut.edges.end()) return "a break of a missing connection";
            cut.edges.erase(gone, cut.edges.end());
        }
        if (!findOrder(cut).orderable()) return "a cut that leaves a loop";
    }
    return {};
}

// The reason why it is not a valid order; empty = it is one.
std::string flawOfOrder(const OrderProblem& problem, const OrderResult& result) {
    if (result.order.size() != problem.names.size()) return "not all components";
    std::vector<std::size_t> position(problem.names.size());
    for (std::size_t i = 0; i < result.order.size(); ++i) position[result.order[i]] = i;
    for (const Edge& edge : problem.edges) {
        if (position[edge.from] >= position[edge.to]) return "a reader before its writer";
    }
    return {};
}

struct ClassCount {
    unsigned nodes;
    std::size_t graphs;   // https://oeis.org/A000595
    std::size_t acyclic;  // https://oeis.org/A003087
};

class AllDigraphs : public ::testing::TestWithParam<ClassCount> {};

TEST_P(AllDigraphs, AreOrderedOrRejectedWithACorrectLoopAndWorkingBreaks) {
    const auto [nodes, expected_graphs, expected_acyclic] = GetParam();
    const std::vector<Digraph> graphs = digraphsUpToIsomorphism(nodes);
    ASSERT_EQ(graphs.size(), expected_graphs);
#ifdef RTCF_SANITIZED
    const std::size_t stride = nodes == 5 ? 97 : 1;
#else
    const std::size_t stride = 1;
#endif
    std::size_t acyclic = 0;
    for (std::size_t i = 0; i < graphs.size(); i += stride) {
        const OrderProblem problem = problemOf(graphs[i], nodes);
        const OrderResult result = findOrder(problem);
        ASSERT_EQ(result.orderable(), isAcyclic(graphs[i], nodes)) << graphs[i];
        if (result.orderable()) {
            ++acyclic;
            ASSERT_EQ(flawOfOrder(problem, result), "") << graphs[i];
        } else {
            ASSERT_TRUE(result.order.empty());
            ASSERT_EQ(flawOfLoop(problem, result.loop), "") << graphs[i];
            ASSERT_EQ(flawOfCuts(problem, result), "") << graphs[i];
        }
    }
    if (stride == 1) {
        EXPECT_EQ(acyclic, expected_acyclic);
    }
}

INSTANTIATE_TEST_SUITE_P(UpTo5Nodes, AllDigraphs,
                         ::testing::Values(ClassCount{1, 2, 1}, ClassCount{2, 10, 2},
                                           ClassCount{3, 104, 6}, ClassCount{4, 3044, 31},
                                           ClassCount{5, 291968, 302}),
                         [](const auto& suite) {
                             return "Of" + std::to_string(suite.param.nodes);
                         });

}  // namespace
}  // namespace rtcf::test
