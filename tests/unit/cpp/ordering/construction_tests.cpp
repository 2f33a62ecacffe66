// The order of construction is the order of execution, as far as it is known in advance.
#include "ordering/construction.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "support/graph_fixture.hpp"

namespace rtcf::test {
namespace {

using namespace executor;

class ConstructionTest : public GraphFixture {
   protected:
    // A graph of `count` components, each input of which reads a random output, or none.
    void draw(std::mt19937& random, std::size_t count) {
        const auto one_of = [&random](std::size_t all) {
            return std::uniform_int_distribution<std::size_t>(0, all - 1)(random);
        };
        std::vector<std::size_t> names(count);
        for (std::size_t i = 0; i < count; ++i) names[i] = i;
        std::shuffle(names.begin(), names.end(), random);
        const bool loops = one_of(2) == 0;
        for (std::size_t i = 0; i < count; ++i) {
            Remaps remaps{{"out1", "o" + std::to_string(i)}, {"out2", "~out2"}};
            for (const char* input : {"in1", "in2", "in3", "in4"}) {
                const std::size_t from = loops ? one_of(count) : one_of(i + 1);
                const bool reads = from != i && one_of(3) == 0;
                remaps.emplace_back(input,
                                    reads ? "o" + std::to_string(from) : "~" + std::string(input));
            }
            const std::string ignored = one_of(4) == 0 ? "/o" + std::to_string(one_of(count)) : "";
            instances_.push_back(
                mimo("C" + std::to_string(names[i]), std::move(remaps), one_of(8) == 0, ignored));
            components_.push_back({instances_.back()->definition(), {}, false, ports_});
            if (one_of(4) == 0) components_.back().definition.breaks.ports.insert("in1");
        }
        std::vector<std::size_t> order(count);
        for (std::size_t i = 0; i < count; ++i) order[i] = i;
        std::shuffle(order.begin(), order.end(), random);
        for (const std::size_t i : order) {
            graph_.add({instances_[i], components_[i].definition.breaks});
            wanted_.push_back(&components_[i]);
        }
    }

    std::vector<std::shared_ptr<Instance>> instances_;
    std::vector<WantedComponent> components_;
    Graph graph_;
    std::vector<const WantedComponent*> wanted_;
    const std::shared_ptr<const TypePorts> ports_ =
        std::make_shared<TypePorts>(TypePorts{{"in1", "in2", "in3", "in4"}, {"out1", "out2"}});
};

TEST_F(ConstructionTest, IsInTheOrderOfExecution) {
    std::mt19937 random(7);
    int orderable = 0;
    int loops = 0;
    for (int round = 0; round < 200; ++round) {
        SCOPED_TRACE(round);
        instances_.clear();
        components_.clear();
        components_.reserve(12);
        graph_ = {};
        wanted_.clear();
        draw(random, 12);
        const std::vector<std::size_t> order = constructionOrder(wanted_);
        if (errorOf(graph_).empty()) {
            EXPECT_EQ(order, wire(graph_, {}, {}).order);
            ++orderable;
        } else {
            EXPECT_EQ(std::set<std::size_t>(order.begin(), order.end()).size(), 12U);
            EXPECT_EQ(order.size(), 12U);
            ++loops;
        }
    }
    EXPECT_GT(orderable, 50);
    EXPECT_GT(loops, 20);
}

TEST_F(ConstructionTest, OfComponentsOfUnknownPortsIsByName) {
    WantedComponent b;
    b.definition.name = "B";
    WantedComponent a;
    a.definition.name = "A";
    EXPECT_EQ(constructionOrder({&b, &a}), (std::vector<std::size_t>{1, 0}));
    EXPECT_TRUE(constructionOrder({}).empty());
}

}  // namespace
}  // namespace rtcf::test
