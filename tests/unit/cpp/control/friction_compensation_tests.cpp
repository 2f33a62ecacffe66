#include <gtest/gtest.h>

#include <limits>
#include <rtcf/test.hpp>

#include "control/allocations.hpp"

namespace rtcf::test {
namespace {

// The integration tests compare its numbers with references.
TEST(FrictionCompensation, EndsWithoutAnEffort) {
    Bench bench("FrictionCompensation", {{"coulomb", 2.0}});
    bench.write("velocity", 1.0);
    bench.cycle();
    EXPECT_EQ(*bench.read<double>("effort"), 2.0);
    bench.safe();
    EXPECT_EQ(*bench.read<double>("effort"), 0.0);
}

TEST(FrictionCompensation, DoesNotAllocate) {
    Bench bench("FrictionCompensation", {{"coulomb", 2.0}, {"breakaway", 3.0}});
    bench.cycle();
    double viscous = 0.0;
    for (const double velocity : {0.1, -3.0, std::numeric_limits<double>::quiet_NaN()}) {
        bench.write("velocity", velocity);
        EXPECT_EQ(allocationsInUpdate(bench.component()), 0U);
        bench.set({{"viscous", viscous += 1.0}});
    }
}

}  // namespace
}  // namespace rtcf::test
