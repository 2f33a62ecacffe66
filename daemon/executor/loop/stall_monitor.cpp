#include "loop/stall_monitor.hpp"

#include <pthread.h>
#include <sys/resource.h>

#include <algorithm>
#include <csignal>
#include <utility>

#include "faults/crash_handler.hpp"
#include "loop/loop.hpp"
#include "realtime/cycle_counter.hpp"

namespace rtcf::executor {

namespace {

constexpr std::int64_t kMicrosecond = 1000;
// Ns after the monitor's timeout, so that the monitor acts first if it gets a CPU.
constexpr std::int64_t kMargin = 500'000'000;
constexpr auto kPoll = std::chrono::milliseconds(20);
constexpr std::int64_t kPollNs = 20'000'000;

// State of the SIGXCPU handler. The signal comes once a second from the limit on.
std::atomic<const Loop*> watched_loop{nullptr};
std::atomic<std::uint64_t> progress_at_last_signal{0};

void handleCpuLimit(int /*signal*/) {
    const Loop* loop = watched_loop.load();
    if (loop == nullptr) return;
    // A loop that always overruns, or polls a silent device, never sleeps either, but it makes
    // progress.
    const std::uint64_t now = loop->progress();
    if (progress_at_last_signal.exchange(now) == now && loop->inComponent()) dieStalled();
}

}  // namespace

StallMonitor::StallMonitor(const Loop& loop) : loop_(loop), thread_([this] { threadMain(); }) {
    watched_loop.store(&loop);
    struct sigaction action{};
    action.sa_handler = &handleCpuLimit;
    action.sa_flags = SA_RESTART | SA_ONSTACK;
    sigemptyset(&action.sa_mask);
    sigaction(SIGXCPU, &action, nullptr);
}

StallMonitor::~StallMonitor() {
    setTimeout(0);
    watched_loop.store(nullptr);
    ending_.store(true);
    thread_.join();
}

void StallMonitor::setTimeout(std::int64_t timeout_ns) {
    timeout_ns_.store(timeout_ns);
    rlimit limit{};
    if (getrlimit(RLIMIT_RTTIME, &limit) != 0) return;
    const auto wanted = static_cast<rlim_t>((timeout_ns + kMargin) / kMicrosecond);
    limit.rlim_cur = timeout_ns == 0 ? limit.rlim_max : std::min(limit.rlim_max, wanted);
    setrlimit(RLIMIT_RTTIME, &limit);
}

void StallMonitor::threadMain() {
    pthread_setname_np(pthread_self(), "rtcf-monitor");
    std::uint64_t last = 0;
    std::int64_t polled = monotonicNow();
    std::int64_t stalled = 0;
    while (!ending_.load()) {
        std::this_thread::sleep_for(kPoll);
        const std::uint64_t progress = loop_.progress();
        const std::int64_t now = monotonicNow();
        // Counted in polls of this thread: a debugger or SIGSTOP stops the whole process, and that
        // time must not count as a stall.
        stalled += std::min(now - std::exchange(polled, now), 2 * kPollNs);
        // Between cycles, a loop may wait for long; only a hook that does not return is a stall.
        if (!loop_.inComponent() || progress != last) {
            last = progress;
            stalled = 0;
            continue;
        }
        const std::int64_t timeout = timeout_ns_.load();
        if (timeout != 0 && stalled > timeout) dieStalled();
    }
}

}  // namespace rtcf::executor
