// Measures the time that the real-time thread spends at the cycle boundary on a change
// of a parameter, a load and an unload, by the size of the graph, with cold caches.
// Prints JSON.
// Usage: adoption_cost LIBRARY [ROUNDS]
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "bench_graph.hpp"

namespace {

using rtcf::bench::BenchGraph;
using rtcf::executor::HistogramSnapshot;

constexpr std::size_t kLengths[] = {10, 1000, 4000};
constexpr std::size_t kMoreThanCaches = std::size_t{128} << 20;  // bytes

// The caches as a cycle finds them after other processes have used the CPU.
void flushCaches() {
    static std::vector<unsigned char> memory(kMoreThanCaches);
    for (std::size_t at = 0; at < memory.size(); at += 64) ++memory[at];
}

// Duration of an adoption in ns, as the loop measures it.
double adoptionOf(BenchGraph& graph, const std::function<void()>& change) {
    const HistogramSnapshot before = graph.loop().statistics().adoption.snapshot();
    change();
    const HistogramSnapshot after = graph.loop().statistics().adoption.snapshot();
    return rtcf::executor::summarize(difference(after, before), graph.loop().counter().nsPerTick())
        .max;
}

double median(std::vector<double> values) {
    std::nth_element(values.begin(),
                     values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
    return values[values.size() / 2];
}

}  // namespace

int main(int argc, char** argv) try {
    if (argc < 2 || argc > 3) {
        std::fputs("usage: adoption_cost LIBRARY [ROUNDS]\n", stderr);
        return 2;
    }
    const std::size_t rounds = argc == 3 ? std::stoul(argv[2]) : 31;
    std::vector<std::string> rows;
    for (const std::size_t length : kLengths) {
        BenchGraph graph(rtcf::bench::chain(length), argv[1]);
        const auto wave = graph.make("Wave", "wave");
        rtcf::executor::Graph larger = graph.plan().graph;
        larger.add({wave, {}});
        graph.adopt(larger);
        graph.loop().beginStepping({}, graph.loop().stops());
        graph.loop().step(20);
        std::map<std::string, std::vector<double>> found;
        for (std::size_t round = 0; round < rounds; ++round) {
            rtcf::executor::Adoption values;
            values.values = wave->stageParameters(
                {{"amplitude", 1.0 + 0.01 * static_cast<double>(round % 100)}});
            flushCaches();
            found["set"].push_back(
                adoptionOf(graph, [&] { graph.loop().adopt(values, 1'000'000'000); }));
            wave->releaseStaged();
            const rtcf::executor::Graph small = graph.plan().graph;
            rtcf::executor::Graph grown = small;
            grown.add({graph.make("Mimo", "late", {{"in1", "/c0000"}}), {}});
            found["load"].push_back(adoptionOf(graph, [&] { graph.adopt(grown); }));
            found["unload"].push_back(adoptionOf(graph, [&] { graph.adopt(small); }));
        }
        std::vector<std::string> medians;
        for (const auto& [change, values] : found)
            medians.push_back(fmt::format("\"{}_ns\": {:.0f}", change, median(values)));
        rows.push_back(fmt::format("{{\"components\": {}, {}}}", length, fmt::join(medians, ", ")));
    }
    fmt::print("{{\"rounds\": {}, \"graphs\": [{}]}}\n", rounds, fmt::join(rows, ", "));
    return 0;
} catch (const std::exception& error) {
    std::fprintf(stderr, "adoption_cost: %s\n", error.what());
    return 1;
}
