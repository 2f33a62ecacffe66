#include "realtime/other_threads.hpp"

#include <filesystem>
#include <string>
#include <system_error>
#include <utility>

#include "realtime/cpu_claim.hpp"

namespace rtcf::executor {

namespace {

// A thread that is made by one that has not been moved yet is found by the next pass.
constexpr int kMostPasses = 10;

cpu_set_t cpusWithout(int cpu) {
    cpu_set_t cpus;
    CPU_ZERO(&cpus);
    for (const int each : processCpus()) {
        if (each != cpu) CPU_SET(each, &cpus);
    }
    return cpus;
}

}  // namespace

std::set<pid_t> processThreads() {
    std::set<pid_t> found;
    std::error_code gone;  // one that ends meanwhile
    for (const auto& task : std::filesystem::directory_iterator("/proc/self/task", gone))
        found.insert(static_cast<pid_t>(std::stol(task.path().filename())));
    return found;
}

void OtherThreads::keepOff(int cpu, pid_t loop) {
    const cpu_set_t all = cpusWithout(-1);
    const cpu_set_t others = cpusWithout(cpu);
    if (CPU_COUNT(&others) == 0) return;
    move(narrowed_.value_or(all), others, loop);
    narrowed_ = others;
}

void OtherThreads::release() {
    if (!narrowed_) return;
    move(*narrowed_, cpusWithout(-1), 0);
    narrowed_.reset();
    pinned_.clear();
}

// Whether a thread was pinned or has inherited its CPUs is not to be seen where they are the same.
// So those that have others when threads are moved are known as pinned from then on.
void OtherThreads::move(const cpu_set_t& from, const cpu_set_t& to, pid_t loop) {
    std::set<pid_t> pinned;
    bool moved = true;
    for (int pass = 0; moved && pass < kMostPasses; ++pass) {
        moved = false;
        for (const pid_t thread : processThreads()) {
            if (thread == loop || pinned.count(thread) != 0) continue;
            cpu_set_t present;
            CPU_ZERO(&present);
            if (sched_getaffinity(thread, sizeof present, &present) != 0) continue;  // it has ended
            if (CPU_EQUAL(&present, &to) && pass > 0) continue;
            if (!CPU_EQUAL(&present, &from) || pinned_.count(thread) != 0) {
                pinned.insert(thread);
            } else if (!CPU_EQUAL(&from, &to)) {
                moved = sched_setaffinity(thread, sizeof to, &to) == 0 || moved;
            }
        }
    }
    pinned_ = std::move(pinned);
}

}  // namespace rtcf::executor
