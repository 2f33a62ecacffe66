// Runs Fig. 1 of the paper, or a chain, in the executor's real-time loop and writes the calculation
// duration and wake-up latency of each cycle, one line "duration_ns latency_ns" per cycle.
// ROS mappings are off.
// Usage: paper_run LIBRARY FREQUENCY_HZ SECONDS PRIORITY CPU SPIN_US FILE [LENGTH]
#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <memory>
#include <string>
#include <vector>

#include "bench_graph.hpp"
#include "realtime/realtime.hpp"

namespace {

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::uint64_t kWarmUp = 1000;  // cycles

struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
};

int run(char** argv, const std::vector<rtcf::bench::Node>& nodes) {
    using namespace rtcf;
    executor::prepareProcess();
    executor::LoopSettings settings;
    settings.period_ns = kSecond / std::stol(argv[2]);
    const auto cycles = static_cast<std::uint64_t>(std::stod(argv[3]) * std::stod(argv[2]));
    settings.realtime.priority = static_cast<unsigned>(std::stoul(argv[4]));
    settings.realtime.cpu = std::stoi(argv[5]);
    settings.spin_ns = std::stol(argv[6]) * 1000;
    settings.warmup_cycles = kWarmUp;
    const std::unique_ptr<std::FILE, Close> file(std::fopen(argv[7], "w"));
    if (!file) {
        fmt::print(stderr, "paper_run: cannot write {}\n", argv[7]);
        return 1;
    }
    bench::BenchGraph graph(nodes, argv[1]);
    const auto say = [](const executor::RealtimeProblems& problems) {
        for (const auto& problem : problems) fmt::print(stderr, "paper_run: {}\n", problem.text);
    };
    say(executor::lockMemory(settings.realtime));
    say(executor::checkScheduling(settings.realtime));
    say(graph.loop().start(settings, graph.loop().stops()));
    for (std::uint64_t taken = 0; taken < cycles;) {
        const timespec pause{0, 20'000'000};
        nanosleep(&pause, nullptr);
        if (!graph.loop().running()) break;
        executor::CycleRecord record{};
        while (taken < cycles && graph.nextCycle(record)) {
            if (record.iteration < kWarmUp) continue;
            ++taken;
            fmt::print(file.get(), "{} {}\n", record.duration_ns, record.latency_ns);
        }
    }
    const executor::LoopStatistics& statistics = graph.loop().statistics();
    fmt::print("{{\"cycles\": {}, \"overruns\": {}, \"missed\": {}, \"records_dropped\": {}}}\n",
               statistics.iteration.load(), statistics.overruns.value(), statistics.missed.value(),
               graph.cyclesLost());
    return 0;
}

}  // namespace

int main(int argc, char** argv) try {
    if (argc == 8) return run(argv, rtcf::bench::paperGraph());
    if (argc == 9) return run(argv, rtcf::bench::chain(std::stoul(argv[8])));
    std::fputs(
        "usage: paper_run LIBRARY FREQUENCY_HZ SECONDS PRIORITY CPU SPIN_US FILE "
        "[LENGTH]\n",
        stderr);
    return 2;
} catch (const std::exception& error) {
    std::fprintf(stderr, "paper_run: %s\n", error.what());
    return 1;
}
