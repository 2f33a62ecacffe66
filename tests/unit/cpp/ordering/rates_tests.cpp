// Components that run every n-th cycle: their cycles, and their times. Stepped, so that each cycle
// is known.
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "support/runner_fixture.hpp"

namespace rtcf::test {
namespace {

class Rates : public RunnerFixture {
   protected:
    static ComponentDefinition watch(const std::string& name, std::uint32_t every) {
        ComponentDefinition result = definition("Watch", name);
        result.remaps = {{"in", "count"}};
        for (const char* port : {"updates", "nominal", "since", "age", "cycle"})
            result.remaps.emplace_back(port, name + "_" + port);
        result.every = every;
        return result;
    }

    static ComponentDefinition watch(const std::string& name, std::uint32_t every,
                                     std::uint32_t phase) {
        ComponentDefinition result = watch(name, every);
        result.phase = phase;
        return result;
    }

    // The number of these components that run in each of the next `cycles` cycles.
    std::vector<int> loadOfCycles(const std::vector<std::string>& names, int cycles) {
        std::vector<int> result;
        std::map<std::string, double> before;
        for (const std::string& name : names) before[name] = updates(name);
        for (int i = 0; i < cycles; ++i) {
            step(1);
            int ran = 0;
            for (const std::string& name : names) {
                const double now = updates(name);
                ran += now != before[name] ? 1 : 0;
                before[name] = now;
            }
            result.push_back(ran);
        }
        return result;
    }

    double updates(const std::string& name) {
        const double count = value(name, "updates");
        return std::isnan(count) ? 0.0 : count;
    }
};

TEST_F(Rates, ComponentRunsInItsPhaseOfEveryNthCycle) {
    load(watch("W", 4, 1));
    step(1);
    EXPECT_EQ(updates("/W"), 0.0);
    step(1);
    EXPECT_EQ(updates("/W"), 1.0);
    step(40);
    EXPECT_EQ(updates("/W"), 11.0);
    EXPECT_EQ(value("/W", "cycle"), 41.0);
}

TEST_F(Rates, PeriodAndElapsedAreThoseOfTheComponent) {
    load(watch("F", 1));
    load(watch("S", 5, 2));
    step(3);
    EXPECT_EQ(value("/S", "nominal"), 5.0);
    EXPECT_EQ(value("/S", "since"), 5.0) << "never below its period, even at first";
    step(20);
    EXPECT_EQ(value("/S", "since"), 5.0);
    EXPECT_EQ(value("/F", "nominal"), 1.0);
    EXPECT_EQ(value("/F", "since"), 1.0);
}

TEST_F(Rates, AgeOfAnInputIsTheTimeSinceItWasWritten) {
    ComponentDefinition writer = watch("A", 4, 0);
    writer.remaps = {{"updates", "count"}};  // in cycles 0, 4, 8…
    load(writer);
    load(watch("B", 1));
    for (int cycle = 0; cycle < 12; ++cycle) {
        step(1);
        EXPECT_EQ(value("/B", "age"), static_cast<double>(cycle % 4)) << cycle;
    }
}

TEST_F(Rates, DefaultPhasesSpreadTheLoad) {
    std::vector<std::string> names;
    for (int i = 0; i < 4; ++i) {
        names.push_back("/W" + std::to_string(i));
        load(watch("W" + std::to_string(i), 4));
    }
    EXPECT_EQ(loadOfCycles(names, 8), std::vector<int>(8, 1));
}

TEST_F(Rates, LoadingAnotherComponentChangesNoPhase) {
    load(watch("M", 4));
    step(9);
    const double before = value("/M", "cycle");
    for (const char* name : {"A", "B", "Z"}) load(watch(name, 2));
    step(4);
    EXPECT_EQ(value("/M", "cycle"), before + 4);
    EXPECT_EQ(value("/M", "since"), 4.0);
}

TEST_F(Rates, IncompatibleRateIsRejectedWithTheNearestCompatibleOne) {
    load(watch("A", 4));
    load(watch("B", 12));
    const std::vector<std::string> before = order();
    const std::string text = errorOf([&] { load(watch("C", 5)); });
    EXPECT_NE(text.find("/C runs every 5 cycles"), std::string::npos) << text;
    EXPECT_NE(text.find("--every 4 or 12"), std::string::npos) << text;
    EXPECT_EQ(order(), before);
    EXPECT_EQ(errorOf([&] { load(watch("C", 4)); }), "");
    EXPECT_EQ(errorOf([&] { load(watch("D", 12)); }), "");
    EXPECT_EQ(errorOf([&] { load(watch("E", 1)); }), "");
}

TEST_F(Rates, ErrorNamesTheReplacementNotTheOthers) {
    load(watch("A", 2));
    load(watch("B", 6));
    const std::string text = errorOf([&] { replace("/A", watch("A", 4)); });
    EXPECT_NE(text.find("/A runs every 4 cycles"), std::string::npos) << text;
    EXPECT_NE(text.find("--every 3 or 6"), std::string::npos) << text;
}

// The advice of the error is correct for all pairs of rates up to 24.
TEST_F(Rates, AdviceOfAnErrorIsAccepted) {
    for (std::uint32_t first = 2; first <= 24; first += 2) {
        load(watch("A", first));
        for (std::uint32_t second = 2; second <= 24; ++second) {
            const std::string text = errorOf([&] { load(watch("B", second)); });
            const bool harmonic = first % second == 0 || second % first == 0;
            ASSERT_EQ(text.empty(), harmonic) << first << " and " << second << ": " << text;
            if (harmonic) {
                unload("/B");
                continue;
            }
            const std::size_t at = text.find("--every ") + std::string("--every ").size();
            const auto advised = static_cast<std::uint32_t>(std::stoul(text.substr(at)));
            ASSERT_EQ(errorOf([&] { load(watch("B", advised)); }), "") << text;
            unload("/B");
        }
        unload("/A");
    }
}

TEST_F(Rates, RateChangesInARunningLoop) {
    load(watch("W", 1));
    start();
    ASSERT_TRUE(runs());
    replace("/W", watch("W", 10, 3));
    ASSERT_TRUE(eventually([&] { return updates("/W") > 10.0; }));
    EXPECT_EQ(static_cast<int>(value("/W", "cycle")) % 10, 3);
    EXPECT_EQ(value("/W", "nominal"), 10.0);
}

}  // namespace
}  // namespace rtcf::test
