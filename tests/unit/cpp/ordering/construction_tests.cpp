// The order of construction is the order of execution, as far as it is known in advance.
#include "ordering/construction.hpp"

#include <gtest/gtest.h>

#include <algorithm>
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
            definitions_.push_back(instances_.back()->definition());
            if (one_of(4) == 0) definitions_.back().breaks.insert("in1");
        }
        std::vector<std::size_t> order(count);
        for (std::size_t i = 0; i < count; ++i) order[i] = i;
        std::shuffle(order.begin(), order.end(), random);
        for (const std::size_t i : order) {
            graph_.add({instances_[i], definitions_[i].breaks});
            blueprints_.push_back({&definitions_[i], instances_[0]->ports().get()});
        }
    }

    std::vector<std::shared_ptr<Instance>> instances_;
    std::vector<ComponentDefinition> definitions_;
    Graph graph_;
    std::vector<Blueprint> blueprints_;
};

TEST_F(ConstructionTest, IsInTheOrderOfExecution) {
    std::mt19937 random(7);
    int orderable = 0;
    int loops = 0;
    for (int round = 0; round < 200; ++round) {
        SCOPED_TRACE(round);
        instances_.clear();
        definitions_.clear();
        definitions_.reserve(12);
        graph_ = {};
        blueprints_.clear();
        draw(random, 12);
        const std::vector<std::size_t> order = constructionOrder(blueprints_);
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

TEST_F(ConstructionTest, RejectsAnInvalidPattern) {
    const std::vector<MappedPort> none;
    ComponentDefinition definition;
    definition.name = "A";
    definition.ignore = "(";
    EXPECT_THROW(constructionOrder({{&definition, &none}}), Error);
    EXPECT_TRUE(constructionOrder({}).empty());
}

}  // namespace
}  // namespace rtcf::test
