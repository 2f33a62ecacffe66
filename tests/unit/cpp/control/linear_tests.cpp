// update() of StateSpace and KalmanFilter where RealtimeSanitizer reports calls that are not
// real-time safe. The integration tests compare their values.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <rtcf/test.hpp>
#include <string>

#include "control/allocations.hpp"

namespace rtcf::test {
namespace {

constexpr int kSize = 12;
constexpr int kCycles = 50;

// A matrix with one value on its diagonal and another one beside it.
std::string band(double diagonal, double beside) {
    std::string text;
    for (int i = 0; i < kSize; ++i) {
        for (int j = 0; j < kSize; ++j) {
            const double value = i == j ? diagonal : 0.0;
            text += std::to_string(j == i + 1 ? beside : value) + " ";
        }
        text += "; ";
    }
    return text;
}

void writeAll(Bench& bench, const std::string& name, double value) {
    for (int i = 1; i <= kSize; ++i) bench.write(name + std::to_string(i), value);
}

Bench::Parameters model() {
    return {{"A", band(-2.0, 1.0)},
            {"B", band(1.0, 0.5)},
            {"C", band(1.0, 0.1)},
            {"form", std::string("zoh")}};
}

class Roles : public testing::TestWithParam<const char*> {};

TEST_P(Roles, AreRealTimeSafe) {
    Bench::Parameters parameters = model();
    parameters.emplace_back("role", std::string(GetParam()));
    Bench bench("StateSpace", parameters);
    writeAll(bench, "in", 1.0);
    writeAll(bench, "measured", 0.5);
    bench.cycle();
    for (int i = 0; i < kCycles; ++i) {
        writeAll(bench, "measured", i == kCycles / 2 ? std::nan("") : 0.01 * i);
        EXPECT_EQ(allocationsInUpdate(bench.component()), 0U);
    }
    bench.set({{"C", band(2.0, 0.0)}});
    for (int i = 0; i < kCycles; ++i) EXPECT_EQ(allocationsInUpdate(bench.component()), 0U);
    bench.cycle();
    EXPECT_TRUE(std::isfinite(*bench.read<double>("out12")));
}

INSTANTIATE_TEST_SUITE_P(StateSpace, Roles,
                         testing::Values("system", "observer", "regulator", "lqg"));

TEST(StateSpace, CommandsItsSafeValueWithinTheLimitsInTheLastCycle) {
    for (const char* role : {"regulator", "lqg"}) {
        Bench bench("StateSpace", {{"B", std::string("1 2")},
                                   {"role", std::string(role)},
                                   {"lower", std::string("-1 -1")},
                                   {"upper", std::string("1 3")},
                                   {"safe_value", std::string("2")}});
        bench.write("measured1", 50.0);
        bench.cycle(2);
        EXPECT_EQ(*bench.read<double>("out1"), -1.0);
        EXPECT_EQ(*bench.read<double>("out2"), -1.0);
        bench.safe();
        EXPECT_EQ(*bench.read<double>("out1"), 1.0);
        EXPECT_EQ(*bench.read<double>("out2"), 2.0);
    }
}

TEST(StateSpace, PassesOnASafeCommandInTheLastCycle) {
    Bench bench("StateSpace",
                {{"A", std::string()}, {"B", std::string()}, {"D", std::string("2")}});
    bench.write("in1", 1.0);
    bench.cycle();
    bench.write("in1", 0.0);
    bench.safe();
    EXPECT_EQ(*bench.read<double>("out1"), 0.0);
}

class Modes : public testing::TestWithParam<bool> {};

TEST_P(Modes, AreRealTimeSafe) {
    Bench::Parameters parameters = model();
    parameters.emplace_back("steady", GetParam());
    Bench bench("KalmanFilter", parameters);
    writeAll(bench, "in", 1.0);
    writeAll(bench, "measured", 0.5);
    bench.cycle();
    for (int i = 0; i < kCycles; ++i) {
        // All measurements, some of them, or none.
        if (i % 3 == 0) writeAll(bench, "measured", 0.01 * i);
        if (i % 3 == 1) bench.write("measured3", 0.5);
        if (i % 9 == 1) bench.write("measured4", std::numeric_limits<double>::infinity());
        EXPECT_EQ(allocationsInUpdate(bench.component()), 0U);
    }
    bench.cycle();
    EXPECT_TRUE(std::isfinite(*bench.read<double>("out12")));
    EXPECT_GT(*bench.read<double>("deviation12"), 0.0);
}

INSTANTIATE_TEST_SUITE_P(KalmanFilter, Modes, testing::Bool());

// Changes the period as a running loop does: the next cycle still has the time of the old one.
void changePeriod(Bench& bench, std::int64_t period_ns) {
    Component& component = bench.component();
    for (DerivedBase* derived : accessTo(component).derived()) {
        (void)derived->propose(period_ns);
    }
    ASSERT_TRUE(component.prepare(Values{}));
    for (DerivedBase* derived : accessTo(component).derived()) {
        if (derived->staged()) derived->commit();
        derived->release();
    }
    accessTo(component).context().period_ns = period_ns;
    bench.clock().period_ns = period_ns;
}

TEST(StateSpace, ContinuesExactlyAtANewPeriodAndAfterMissedCycles) {
    Bench bench("StateSpace", {{"A", std::string("0 1; -100 0")},
                               {"B", std::string("0; 100")},
                               {"initial", std::string("1 0")}});
    bench.write("in1", 0.5);
    double time = 0.0;
    std::int64_t period_ns = 1'000'000;
    const auto cycle = [&](std::int64_t elapsed_ns) {
        bench.clock().elapsed_ns = elapsed_ns;
        time += 1e-9 * static_cast<double>(elapsed_ns);
        bench.cycle();
        EXPECT_NEAR(*bench.read<double>("out1"), 0.5 + 0.5 * std::cos(10.0 * time), 1e-12);
    };
    bench.cycle();
    for (const std::int64_t next_ns : {4'000'000, 500'000, 3'000'000}) {
        for (int i = 0; i < kCycles; ++i) cycle(period_ns);
        cycle(3 * period_ns);
        changePeriod(bench, next_ns);
        cycle(period_ns);
        period_ns = next_ns;
    }
}

}  // namespace
}  // namespace rtcf::test
