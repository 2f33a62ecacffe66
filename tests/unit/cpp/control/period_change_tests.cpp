#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <rtcf/test.hpp>
#include <string>
#include <utility>
#include <vector>

#include "control/numbers.hpp"

namespace rtcf::test {
namespace {

constexpr std::int64_t kFirst = 1'000'000;  // ns
constexpr double kTurn = 6.28318530717958647692;

// Runs a component with a period of 1 ms, then of another one. In a running loop, the first cycle
// after the change still comes 1 ms after the last one; in a held loop, a new period.
// @param check called after each cycle, with its time in s
void changePeriod(Bench& bench, std::int64_t period, bool is_running, int cycles,
                  const std::function<void(double)>& write,
                  const std::function<void(double)>& check) {
    std::int64_t time = 0;
    for (int i = 0; i < 2 * cycles; ++i) {
        const bool is_new = i >= cycles;
        accessTo(bench.component()).context().period_ns = is_new ? period : kFirst;
        bench.clock().period_ns = is_new ? period : kFirst;
        bench.clock().elapsed_ns = is_new && (i > cycles || !is_running) ? period : kFirst;
        if (i > 0) time += bench.clock().elapsed_ns;
        write(1e-9 * static_cast<double>(time));
        bench.cycle();
        check(1e-9 * static_cast<double>(time));
    }
}

struct PeriodChange : testing::TestWithParam<std::pair<std::int64_t, bool>> {};

TEST_P(PeriodChange, KeepsTheTimeOfASignal) {
    Bench bench("SignalGenerator", {{"frequency", 20.0}});
    changePeriod(
        bench, GetParam().first, GetParam().second, 100, [](double) {},
        [&](double time) {
            EXPECT_NEAR(*bench.read<double>("out"), std::sin(kTurn * 20.0 * time), kRounding);
        });
}

// A section has exactly its response at its frequency, with any period.
TEST_P(PeriodChange, KeepsTheResponseOfAFilterToAWave) {
    const std::vector<std::pair<std::string, double>> sections{
        {"lowpass 20 5", -5.0}, {"highpass 20 5", 5.0}, {"lowpass 20 0.7; highpass 20 3", 2.1}};
    for (const auto& [text, gain] : sections) {
        const bool is_single = text.find(';') == std::string::npos;
        Bench bench("Biquads", {{"sections", text}});
        changePeriod(
            bench, GetParam().first, GetParam().second, 4000,
            [&](double time) { bench.write("in", std::sin(kTurn * 20.0 * time)); },
            [&, gain = gain](double time) {
                if (time < 3.0) return;
                const double turns = kTurn * 20.0 * time;
                EXPECT_NEAR(*bench.read<double>("out"),
                            gain * (is_single ? std::cos(turns) : std::sin(turns)), kRounding)
                    << text << " at " << time;
            });
    }
}

// All kinds of sections: the output changes by hardly more than its wave does in a period. The
// response differs somewhat, except at the frequency of a section.
TEST_P(PeriodChange, AddsNoSpike) {
    for (const char* const text :
         {"lowpass 20 5", "highpass 20 0.7", "notch 50 5; bandpass 30 2", "lead_lag 5 40",
          "butterworth_lowpass 5 30", "butterworth_highpass 3 2"}) {
        Bench bench("Biquads", {{"sections", std::string(text)}});
        double last = 0.0;
        double largest = 0.0;
        double before = 0.0;
        changePeriod(
            bench, GetParam().first, GetParam().second, 2000,
            [&](double time) { bench.write("in", std::sin(kTurn * 5.0 * time)); },
            [&](double time) {
                const double out = *bench.read<double>("out");
                const double turn = kTurn * 5.0 * std::max(time - before, 1e-9);
                if (time > 1.0 && time < 1.9) largest = std::max(largest, std::abs(out));
                if (time > 1.9) {
                    EXPECT_LE(std::abs(out - last), 1.25 * turn * largest + 1e-6)
                        << text << " at " << time;
                }
                last = out;
                before = time;
            });
    }
}

TEST_P(PeriodChange, KeepsAConstantOutputExactly) {
    Bench bench("Biquads", {{"sections", std::string("notch 50 5; bandpass 30 2; lowpass 9 3")}});
    changePeriod(
        bench, GetParam().first, GetParam().second, 50, [&](double) { bench.write("in", 2.5); },
        [&](double) { EXPECT_EQ(*bench.read<double>("out"), 0.0); });
    Bench passing("Biquads", {{"sections", std::string("notch 50 5; lead_lag 5 40; lowpass 9 3")}});
    changePeriod(
        passing, GetParam().first, GetParam().second, 50, [&](double) { passing.write("in", 2.5); },
        [&](double) { EXPECT_EQ(*passing.read<double>("out"), 2.5); });
}

TEST(PeriodAndSections, AreFaded) {
    Bench bench("Biquads", {{"sections", std::string("lowpass 2 0.7")}});
    int cycle = 0;
    double last = 1.0;
    changePeriod(
        bench, 4'000'000, false, 200,
        [&](double time) {
            if (cycle == 200) bench.set({{"sections", std::string("highpass 2 0.7")}});
            bench.write("in", 1.0 + time);
        },
        [&](double) {
            const double out = *bench.read<double>("out");
            EXPECT_NEAR(out, last, 0.06) << cycle;  // the step without a transition is 1
            last = out;
            ++cycle;
        });
    EXPECT_NEAR(last, 0.0, 0.2);
}

INSTANTIATE_TEST_SUITE_P(Loop, PeriodChange,
                         testing::Values(std::pair{4'000'000, true}, std::pair{4'000'000, false},
                                         std::pair{250'000, true}, std::pair{250'000, false},
                                         std::pair{2'000'000, true}));

}  // namespace
}  // namespace rtcf::test
