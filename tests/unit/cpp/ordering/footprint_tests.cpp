#include "ordering/footprint.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <set>

#include "ordering/plan.hpp"
#include "support/graph_fixture.hpp"

namespace rtcf::test {
namespace {

using namespace executor;

class FootprintTest : public GraphFixture {
   protected:
    std::unique_ptr<Plan> planOf(const std::vector<std::shared_ptr<Instance>>& instances) {
        Graph graph = graphOf(instances);
        Wiring wiring = wire(graph, {}, {});
        Adoption adoption;
        return buildPlan(std::move(graph), std::move(wiring), empty_, 1000.0, adoption);
    }

    const Plan empty_;
};

bool covers(const std::vector<const void*>& lines, const void* address) {
    return std::any_of(lines.begin(), lines.end(), [address](const void* line) {
        const auto offset =
            reinterpret_cast<std::uintptr_t>(address) - reinterpret_cast<std::uintptr_t>(line);
        return offset < kCacheLine;
    });
}

TEST_F(FootprintTest, EmptyGraphHasNone) { EXPECT_TRUE(planOf({})->schedule.footprint.empty()); }

TEST_F(FootprintTest, CoversStepsComponentsPortsAndValues) {
    const auto plan = planOf(fig1());
    const auto& lines = plan->schedule.footprint;
    for (const Step& step : plan->schedule.steps) {
        EXPECT_TRUE(covers(lines, &step));
        EXPECT_TRUE(covers(lines, step.component));
        for (const InputPort* input : accessTo(*step.component).inputs())
            EXPECT_TRUE(covers(lines, &input->input()));
        for (const OutputPort* output : accessTo(*step.component).outputs()) {
            EXPECT_TRUE(covers(lines, &output->output()));
            EXPECT_TRUE(covers(lines, output->slot().get()));
        }
    }
}

TEST_F(FootprintTest, NamesNoLineTwice) {
    const auto plan = planOf(fig1());
    const auto& lines = plan->schedule.footprint;
    EXPECT_EQ(std::set<const void*>(lines.begin(), lines.end()).size(), lines.size());
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(lines.front()) % kCacheLine, 0U);
}

TEST_F(FootprintTest, OfALongChainCoversItsStart) {
    std::vector<std::shared_ptr<Instance>> chain;
    for (int i = 0; i < 100; ++i) {
        const std::string name = "m" + std::to_string(i);
        chain.push_back(mimo(name, {{"out1", name + "_1"}, {"out2", name + "_2"}}));
    }
    const auto plan = planOf(chain);
    const auto& lines = plan->schedule.footprint;
    EXPECT_EQ(lines.size(), kLargestFootprint);
    EXPECT_TRUE(covers(lines, plan->schedule.steps.front().component));
    EXPECT_FALSE(covers(lines, plan->schedule.steps.back().component));
}

}  // namespace
}  // namespace rtcf::test
