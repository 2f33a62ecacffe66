// Runs cycles of Fig. 1 of the paper, or of a chain, for a tool that counts
// instructions (callgrind). Usage: loop_instructions LIBRARY fig1|mapped|CHAIN CYCLES
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>

#include "bench_graph.hpp"

int main(int argc, char** argv) try {
    if (argc != 4) {
        std::fputs("usage: loop_instructions LIBRARY fig1|mapped|LENGTH CYCLES\n", stderr);
        return 2;
    }
    const std::string which = argv[2];
    const bool paper = which == "fig1" || which == "mapped";
    const char* whitelist = which == "mapped" ? ".*R3_G2H1|.*R1_H1R2|.*G2_R2" : "";
    rtcf::bench::BenchGraph graph(paper ? rtcf::bench::paperGraph() : rtcf::bench::chain(std::stoul(which)), argv[1],
                                  whitelist);
    graph.loop().beginStepping({});
    const std::uint64_t cycles = std::stoull(argv[3]);
    const std::uint64_t done = graph.loop().step(cycles);
    std::printf("%llu cycles\n", static_cast<unsigned long long>(done));
    return done == cycles ? 0 : 1;
} catch (const std::exception& error) {
    std::fprintf(stderr, "loop_instructions: %s\n", error.what());
    return 1;
}
