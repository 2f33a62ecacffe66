// Measures the overhead of the framework per component: chains of 1 to 1000 Mimo, run by
// the executor's loop without pacing, alternating with a plain loop that calls update() of
// the same components, and compared with the duration of one counter read in the same run.
// Prints JSON.
// Usage: component_cost LIBRARY [ROUNDS]
#include <fmt/format.h>
#include <sched.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>
#include <vector>

#include "bench_graph.hpp"
#include "realtime/cycle_counter.hpp"

namespace {

using rtcf::Component;
using rtcf::bench::BenchGraph;
using rtcf::executor::readCycleCounter;

constexpr std::size_t kLengths[] = {1, 10, 100, 1000};
constexpr std::size_t kUpdatesPerTurn = 10000;  // short turns: most are not interrupted
constexpr double kBudgetAboveReadNs = 5.0;

constexpr double kUndisturbed = 0.1;  // share of turns in which no other process used the caches

double quantile(std::vector<double> values, double share) {
    std::sort(values.begin(), values.end());
    return values[static_cast<std::size_t>(share * static_cast<double>(values.size()))];
}

double median(std::vector<double> values) { return quantile(std::move(values), 0.5); }

// Ticks per counter read, back to back.
double counterReadTicks() {
    constexpr int kReads = 4096;
    const std::int64_t begin = readCycleCounter();
    std::int64_t last = begin;
    for (int i = 0; i < kReads; ++i) last = readCycleCounter();
    return static_cast<double>(last - begin) / kReads;
}

// Ticks per cycle of the chain, in rtcf's loop and in the plain loop.
struct Turn {
    double loop;
    double direct;
};

Turn turn(BenchGraph& graph, std::uint64_t cycles) {
    const std::int64_t begin = readCycleCounter();
    graph.loop().step(cycles);
    const std::int64_t middle = readCycleCounter();
    for (std::uint64_t i = 0; i < cycles; ++i) {
        for (Component* component : graph.order()) component->update();
    }
    const std::int64_t end = readCycleCounter();
    const auto count = static_cast<double>(cycles);
    return {static_cast<double>(middle - begin) / count, static_cast<double>(end - middle) / count};
}

// Pins the process to one CPU, so that all turns use the same caches.
void pin() {
    cpu_set_t cpus;
    CPU_ZERO(&cpus);
    CPU_SET(sched_getcpu(), &cpus);
    sched_setaffinity(0, sizeof cpus, &cpus);
}

struct Row {
    std::size_t length;
    double loop_ns;
    double direct_ns;
    double framework_ns;    // per cycle: median of the differences of neighbouring turns
    double undisturbed_ns;  // the same for the best turns
};

}  // namespace

int main(int argc, char** argv) try {
    if (argc < 2 || argc > 3) {
        std::fputs("usage: component_cost LIBRARY [ROUNDS]\n", stderr);
        return 2;
    }
    const std::size_t rounds = argc == 3 ? std::stoul(argv[2]) : 301;
    pin();
    std::vector<std::unique_ptr<BenchGraph>> graphs;
    for (const std::size_t length : kLengths) {
        graphs.push_back(std::make_unique<BenchGraph>(rtcf::bench::chain(length), argv[1]));
        rtcf::executor::Loop& loop = graphs.back()->loop();
        loop.beginStepping({}, loop.stops());
    }
    constexpr std::size_t kCount = std::size(kLengths);
    std::vector<double> reads;
    std::vector<std::vector<double>> loop(kCount);
    std::vector<std::vector<double>> direct(kCount);
    std::vector<std::vector<double>> difference(kCount);
    for (std::size_t round = 0; round < rounds; ++round) {
        reads.push_back(counterReadTicks());
        for (std::size_t i = 0; i < kCount; ++i) {
            const std::uint64_t cycles = std::max<std::uint64_t>(kUpdatesPerTurn / kLengths[i], 10);
            turn(*graphs[i], 2);  // warm
            const Turn measured = turn(*graphs[i], cycles);
            loop[i].push_back(measured.loop);
            direct[i].push_back(measured.direct);
            difference[i].push_back(measured.loop - measured.direct);
        }
    }
    const double scale = graphs[0]->loop().counter().nsPerTick();
    std::vector<Row> rows;
    for (std::size_t i = 0; i < kCount; ++i) {
        rows.push_back({kLengths[i], median(loop[i]) * scale, median(direct[i]) * scale,
                        median(difference[i]) * scale,
                        quantile(difference[i], kUndisturbed) * scale});
    }
    const double read_ns = median(reads) * scale;
    const double budget_ns = read_ns + kBudgetAboveReadNs;
    fmt::print(R"({{"counter_read_ns": {:.2f}, "budget_ns": {:.2f}, "rounds": {}, "chains": [)",
               read_ns, budget_ns, rounds);
    for (const Row& row : rows) {
        // A cycle has a fixed duration, which the chain of one shows. The slope from there is the
        // duration per added component.
        const auto further = [&](double present, double first) {
            return row.length == 1 ? present
                                   : (present - first) / static_cast<double>(row.length - 1);
        };
        fmt::print(
            "{}{{\"length\": {}, \"loop_ns\": {:.1f}, \"direct_ns\": {:.1f}, \"framework_ns\": "
            "{:.1f}, "
            "\"per_component_ns\": {:.2f}, \"undisturbed_ns\": {:.2f}}}",
            row.length == 1 ? "" : ", ", row.length, row.loop_ns, row.direct_ns, row.framework_ns,
            further(row.framework_ns, rows[0].framework_ns),
            further(row.undisturbed_ns, rows[0].undisturbed_ns));
    }
    fmt::print("]}}\n");
    return 0;
} catch (const std::exception& error) {
    std::fprintf(stderr, "component_cost: %s\n", error.what());
    return 1;
}
