// Counts the instructions of a cycle. The executor's loop runs a graph in a child process,
// single-stepped, and each read of the time stamp counter returns the number of
// instructions so far. The loop's statistics, its calculation duration and that of each
// component, are then instruction counts, exact and reproducible. `whole` is a full step,
// including the pacing. Prints JSON. x86-64 only.
// Usage: instruction_count LIBRARY fig1|published|subscribed|message|LENGTH [CYCLES | trace]
// `trace` prints the instructions of one cycle instead, one per line, in hexadecimal numbers: its
// bytes, rip, rsp, rax, rbx, rcx, rdx, rsi, rdi, rbp, r8 to r15, and the base of fs.
#include <fmt/format.h>
#include <sys/ptrace.h>
#include <sys/user.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <map>
#include <string>

#include "bench_graph.hpp"
#include "statistics/histogram.hpp"

namespace {

// Variants of Fig. 1, with their mapped connections: none, three outputs, or one input, in the last
// variant with a message in each cycle.
const std::map<std::string, std::string> kVariants{
    {"fig1", ""},
    {"published", ".*R3_G2H1|.*R1_H1R2|.*H1_F1"},
    {"subscribed", ".*G2_R2"},
    {"message", ".*G2_R2"},
};
constexpr std::uint64_t kWarmUp = 10;  // cycles

// The child: stops itself before and after the counted part.
// @param cycles 0 = one cycle to be traced
int runCounted(const std::string& library, const std::string& which, std::uint64_t cycles) {
    using namespace rtcf;
    const auto variant = kVariants.find(which);
    const bool paper = variant != kVariants.end();
    bench::BenchGraph graph(paper ? bench::paperGraph() : bench::chain(std::stoul(which)), library,
                            paper ? variant->second : "");
    executor::LoopSettings settings;
    settings.warmup_cycles = kWarmUp;
    graph.loop().beginStepping(settings, graph.loop().stops());
    graph.loop().step(kWarmUp);
    ptrace(PTRACE_TRACEME, 0, nullptr, nullptr);
    raise(SIGSTOP);
    if (cycles == 0) {
        (void)executor::readCycleCounter();
        graph.loop().step(1);
        (void)executor::readCycleCounter();
        raise(SIGSTOP);
        return 0;
    }
    // The end of a cycle, after its last counter read, is visible from here only.
    const auto taken = [&](std::uint64_t steps) {
        const std::int64_t begin = executor::readCycleCounter();
        graph.loop().step(steps);
        return executor::readCycleCounter() - begin;
    };
    std::int64_t whole = 0;
    for (std::uint64_t i = 0; i < cycles; ++i) {
        if (which == "message") graph.deliver();
        whole += taken(1) - taken(0);
    }
    raise(SIGSTOP);
    // Mean and maximum are exact, the histogram's quantiles are not.
    const executor::DistributionSummary cycle =
        summarize(graph.statistics().duration().snapshot(), 1.0);
    fmt::print(
        "{{\"graph\": \"{}\", \"cycles\": {}, \"instructions\": {:.1f}, \"max\": {}, "
        "\"whole\": {:.1f}, \"components\": {{",
        which, cycle.count, cycle.mean, cycle.max,
        static_cast<double>(whole) / static_cast<double>(cycles));
    const char* separator = "";
    const executor::Schedule& schedule = graph.plan().schedule;
    for (const executor::Step& step : schedule.steps) {
        const auto update = summarize(schedule.turnOf(step).statistics->duration.snapshot(), 1.0);
        fmt::print("{}\"{}\": {}", separator, step.component->name(), update.p50);
        separator = ", ";
    }
    fmt::print("}}}}\n");
    return 0;
}

bool waitForStop(pid_t child) {
    int status = 0;
    return waitpid(child, &status, 0) == child && WIFSTOPPED(status);
}

// @return whether the child's next instruction is RDTSC
bool readsCounter(pid_t child, const user_regs_struct& registers) {
    constexpr long kOpcode = 0x310f;
    errno = 0;
    const long word = ptrace(PTRACE_PEEKTEXT, child, registers.rip, nullptr);
    return errno == 0 && (word & 0xffff) == kOpcode;
}

// Prints the instruction that the child is about to execute.
void print(pid_t child, const user_regs_struct& of) {
    errno = 0;
    const auto low = static_cast<unsigned long>(ptrace(PTRACE_PEEKTEXT, child, of.rip, nullptr));
    const auto high =
        static_cast<unsigned long>(ptrace(PTRACE_PEEKTEXT, child, of.rip + 8, nullptr));
    for (unsigned i = 0; i < 8; ++i) fmt::print("{:02x}", (low >> (8 * i)) & 0xff);
    for (unsigned i = 0; i < 8; ++i) fmt::print("{:02x}", (high >> (8 * i)) & 0xff);
    for (const unsigned long long value :
         {of.rip, of.rsp, of.rax, of.rbx, of.rcx, of.rdx, of.rsi, of.rdi, of.rbp, of.r8, of.r9,
          of.r10, of.r11, of.r12, of.r13, of.r14, of.r15, of.fs_base})
        fmt::print(" {:x}", value);
    fmt::print("\n");
}

// Single-steps the child from its first SIGSTOP to its second.
// @param traces prints the instructions
bool count(pid_t child, bool traces) {
    if (!waitForStop(child)) return false;
    for (std::uint64_t instructions = 0;; ++instructions) {
        user_regs_struct registers{};
        ptrace(PTRACE_GETREGS, child, nullptr, &registers);
        const bool counter = readsCounter(child, registers);
        if (traces) print(child, registers);
        if (ptrace(PTRACE_SINGLESTEP, child, nullptr, nullptr) != 0) return false;
        int status = 0;
        if (waitpid(child, &status, 0) != child || !WIFSTOPPED(status)) return false;
        if (WSTOPSIG(status) == SIGSTOP) break;
        if (!counter) continue;
        ptrace(PTRACE_GETREGS, child, nullptr, &registers);
        registers.rax = instructions & 0xffffffffU;
        registers.rdx = instructions >> 32U;
        ptrace(PTRACE_SETREGS, child, nullptr, &registers);
    }
    ptrace(PTRACE_DETACH, child, nullptr, nullptr);
    int status = 0;
    return waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

}  // namespace

int main(int argc, char** argv) try {
    if (argc < 3 || argc > 4) {
        std::fputs(
            "usage: instruction_count LIBRARY fig1|published|subscribed|message|LENGTH [CYCLES]\n",
            stderr);
        return 2;
    }
    const bool traces = argc == 4 && std::string(argv[3]) == "trace";
    std::uint64_t cycles = traces ? 0 : 50;
    if (argc == 4 && !traces) cycles = std::stoull(argv[3]);
    const pid_t child = fork();
    if (child == 0) return runCounted(argv[1], argv[2], cycles);
    if (count(child, traces)) return 0;
    std::fputs("instruction_count: the counted process failed\n", stderr);
    return 1;
} catch (const std::exception& error) {
    std::fprintf(stderr, "instruction_count: %s\n", error.what());
    return 1;
}
