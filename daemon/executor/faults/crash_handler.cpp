#include "faults/crash_handler.hpp"

#include <execinfo.h>
#include <sched.h>
#include <sys/syscall.h>
#include <ucontext.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <utility>

namespace rtcf::executor {

namespace {

// A signal handler has no parameters for its objects, so these two are global. Set once, before any
// component is loaded.
std::atomic<FlightRecorder*> the_recorder{nullptr};
thread_local ThreadRole this_thread = ThreadRole::Other;

// The instruction at which a signal interrupted the thread.
const void* placeOf(const void* context) {
    const mcontext_t& machine = static_cast<const ucontext_t*>(context)->uc_mcontext;
#if defined(__x86_64__)
    // NOLINTNEXTLINE(performance-no-int-to-ptr): a register
    return reinterpret_cast<const void*>(machine.gregs[REG_RIP]);
#elif defined(__aarch64__)
    // NOLINTNEXTLINE(performance-no-int-to-ptr): a register
    return reinterpret_cast<const void*>(machine.pc);
#else
    static_cast<void>(machine);
    return nullptr;
#endif
}

// Records the call stack. It may be corrupt: a fault in here ends the process at once, because the
// signal is blocked. The essential data is recorded before.
void noteTrace(FlightRecorder& recorder, const void* context) {
    constexpr int kOurs = 2;  // this function and the handler, above the kernel's frame
    std::array<void*, FlightRecorder::kMostFrames + kOurs> frames{};
    const void* place = placeOf(context);
    const int count = ::backtrace(frames.data(), static_cast<int>(frames.size()));
    auto* const end = frames.begin() + count;
    auto* begin = std::find(frames.begin(), end, place);
    if (begin == end) {
        // The instruction is not on the stack: a call through a bad pointer.
        begin = frames.begin() + std::min(count, kOurs);
        *begin = const_cast<void*>(place);  // NOLINT(cppcoreguidelines-pro-type-const-cast)
    }
    recorder.noteTrace(&*begin, std::max<std::size_t>(static_cast<std::size_t>(end - begin), 1));
}

// Handler of crash signals. Async-signal-safe (signal-safety(7)): it uses atomics, system calls,
// and backtrace(), which takes no lock and no memory after its first call.
void handle(int signal, siginfo_t* info, void* context) {
    const int error = errno;
    FlightRecorder* recorder = the_recorder.load();
    const bool first = recorder != nullptr &&
                       recorder->noteCrash(signal, this_thread, CrashReason::Signal, info->si_addr);
    // Leaves real-time scheduling and the loops' CPU, because writing a core may take seconds.
    const sched_param ordinary{};
    sched_setscheduler(0, SCHED_OTHER, &ordinary);
    cpu_set_t all;
    CPU_ZERO(&all);
    for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) CPU_SET(cpu, &all);
    sched_setaffinity(0, sizeof all, &all);
    if (first) noteTrace(*recorder, context);
    std::signal(signal, SIG_DFL);
    // Raises the signal again. It stays pending until the handler returns; then the default action
    // writes a core that shows the faulting frame.
    syscall(SYS_tgkill, getpid(), syscall(SYS_gettid), signal);
    errno = error;
}

}  // namespace

void installCrashHandler(FlightRecorder& recorder) {
    the_recorder.store(&recorder);
    // The first call of backtrace() loads a library.
    std::array<void*, 1> ours{};
    (void)::backtrace(ours.data(), 1);
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

CrashRole::CrashRole(ThreadRole role) noexcept : before_(std::exchange(this_thread, role)) {}

CrashRole::~CrashRole() { this_thread = before_; }

}  // namespace rtcf::executor
