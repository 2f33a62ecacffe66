#include "realtime/other_threads.hpp"

#include <unistd.h>

#include <filesystem>
#include <string>
#include <system_error>
#include <utility>

#include "realtime/cpu_claim.hpp"

namespace rtcf::executor {

namespace {

// A thread may be created by another one that has not been moved yet; the next pass finds it.
constexpr int kMostPasses = 10;

cpu_set_t cpusWithout(int cpu) {
    cpu_set_t cpus;
    CPU_ZERO(&cpus);
    for (const int each : processCpus()) {
        if (each != cpu) CPU_SET(each, &cpus);
    }
    return cpus;
}

// The CPUs of a thread; empty if the thread does not exist.
cpu_set_t cpusOf(pid_t thread) {
    cpu_set_t cpus;
    CPU_ZERO(&cpus);
    sched_getaffinity(thread, sizeof cpus, &cpus);
    return cpus;
}

}  // namespace

std::set<pid_t> processThreads() {
    std::set<pid_t> found;
    std::error_code gone;  // for a thread that ends meanwhile
    for (const auto& task : std::filesystem::directory_iterator("/proc/self/task", gone))
        found.insert(static_cast<pid_t>(std::stol(task.path().filename())));
    return found;
}

void OtherThreads::keepOff(int cpu, pid_t loop) {
    const cpu_set_t others = cpusWithout(cpu);
    if (CPU_COUNT(&others) == 0) return;
    move(others, loop);
    narrowed_ = true;
}

void OtherThreads::release() {
    if (!narrowed_) return;
    move(cpusWithout(-1), 0);
    narrowed_ = false;
    pinned_.clear();
}

// Moves all threads but the loop's to other CPUs, except pinned ones. A thread counts as pinned if
// its CPUs differ from the main thread's when threads are moved. (If they are equal, it may be
// pinned or have inherited them.) The main thread runs no component, so it has the CPUs of every
// thread that is not pinned; the kernel removes CPUs that go offline or leave the process's cgroup
// (cpuset(7)).
void OtherThreads::move(const cpu_set_t& to, pid_t loop) {
    const pid_t main = getpid();
    const cpu_set_t from = cpusOf(main);
    if (sched_setaffinity(main, sizeof to, &to) != 0) return;  // none of the CPUs is online
    const cpu_set_t moved_to = cpusOf(main);
    std::set<pid_t> pinned;
    bool moved = true;
    for (int pass = 0; moved && pass < kMostPasses; ++pass) {
        moved = false;
        for (const pid_t thread : processThreads()) {
            if (thread == main || thread == loop || pinned.count(thread) != 0) continue;
            const cpu_set_t present = cpusOf(thread);
            if (CPU_COUNT(&present) == 0) continue;  // it has ended
            if (CPU_EQUAL(&present, &moved_to) && pass > 0) continue;
            if (!CPU_EQUAL(&present, &from) || pinned_.count(thread) != 0) {
                pinned.insert(thread);
            } else if (!CPU_EQUAL(&from, &moved_to)) {
                moved = sched_setaffinity(thread, sizeof to, &to) == 0 || moved;
            }
        }
    }
    pinned_ = std::move(pinned);
}

}  // namespace rtcf::executor
