#include "faults/crash_handler.hpp"

#include <sched.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdlib>

namespace rtcf::executor {

namespace {

// A signal handler has no owner to be handed things by: these two are the
// exception to "no globals", set once before any component is loaded.
std::atomic<FlightRecorder*> the_recorder{nullptr};
thread_local ThreadRole this_thread = ThreadRole::Other;

// Only what signal-safety(7) and the kernel allow: atomics and system calls.
void handle(int signal, siginfo_t* info, void* /*context*/) {
    const int error = errno;
    if (FlightRecorder* recorder = the_recorder.load()) {
        recorder->noteCrash(signal, this_thread, CrashReason::Signal, info->si_addr);
    }
    // Writing a core may take seconds, which must not be real-time seconds of the loops' CPU.
    const sched_param ordinary{};
    sched_setscheduler(0, SCHED_OTHER, &ordinary);
    cpu_set_t all;
    CPU_ZERO(&all);
    for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) CPU_SET(cpu, &all);
    sched_setaffinity(0, sizeof all, &all);
    std::signal(signal, SIG_DFL);
    // Pending until the handler returns, then the default action: the core shows this very frame.
    syscall(SYS_tgkill, getpid(), syscall(SYS_gettid), signal);
    errno = error;
}

}  // namespace

void installCrashHandler(FlightRecorder& recorder) {
    the_recorder.store(&recorder);
    for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGSYS, SIGTRAP}) {
        struct sigaction action{};
        action.sa_sigaction = &handle;
        action.sa_flags = SA_SIGINFO | SA_ONSTACK;
        sigemptyset(&action.sa_mask);
        sigaction(signal, &action, nullptr);
    }
}

void dieStalled() {
    if (FlightRecorder* recorder = the_recorder.load()) {
        recorder->noteCrash(SIGABRT, ThreadRole::Realtime, CrashReason::Stall, nullptr);
    }
    std::signal(SIGABRT, SIG_DFL);
    std::abort();
}

CrashContext::CrashContext(ThreadRole role) : stack_(new unsigned char[kStack]()) {
    this_thread = role;
    stack_t stack{};
    stack.ss_sp = stack_.get();
    stack.ss_size = kStack;
    sigaltstack(&stack, nullptr);
}

CrashContext::~CrashContext() {
    stack_t stack{};
    stack.ss_flags = SS_DISABLE;
    sigaltstack(&stack, nullptr);
    this_thread = ThreadRole::Other;
}

}  // namespace rtcf::executor
