#include "realtime/realtime.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <link.h>
#include <malloc.h>
#include <sched.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <memory>

#include "realtime/cpu_claim.hpp"
#include "realtime/unlocked_memory.hpp"

namespace rtcf::executor {

namespace {

constexpr std::size_t kThreadStack = 512 * 1024;  // for threads that are not real-time
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
// A sanitizer needs much space in each stack.
constexpr std::size_t kStackReserve = 2048 * 1024;
#else
constexpr std::size_t kStackReserve = 64 * 1024;  // for libc and the loop itself
#endif

std::string systemError(int error) { return std::strerror(error); }

// Touches a block and frees it. The heap never shrinks, so it keeps the pages.
void prefaultHeap(std::size_t bytes) {
    const std::unique_ptr<unsigned char[]> block(new unsigned char[bytes]);
    const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
    for (std::size_t at = 0; at < bytes; at += page) {
        static_cast<volatile unsigned char*>(block.get())[at] = 1;
    }
}

// Unlocks and drops the pages of ICU's tables: 30 MB for text conversion and locales, a dependency
// of ROS logging, and half of the process. Real-time threads do not read them; others read them
// from disk again when needed.
int releaseTextTables(dl_phdr_info* library, std::size_t /*size*/, void* /*unused*/) {
    if (std::strstr(library->dlpi_name, "/libicudata.so") == nullptr) return 0;
    const auto page = static_cast<std::uintptr_t>(sysconf(_SC_PAGESIZE));
    for (unsigned i = 0; i < library->dlpi_phnum; ++i) {
        const ElfW(Phdr) & segment = library->dlpi_phdr[i];
        if (segment.p_type != PT_LOAD || (segment.p_flags & PF_W) != 0) continue;
        const std::uintptr_t begin = (library->dlpi_addr + segment.p_vaddr) / page * page;
        const std::uintptr_t end = library->dlpi_addr + segment.p_vaddr + segment.p_memsz;
        // NOLINTNEXTLINE(performance-no-int-to-ptr): the loader gives addresses as numbers
        void* const address = reinterpret_cast<void*>(begin);
        if (munlock(address, end - begin) == 0) madvise(address, end - begin, MADV_DONTNEED);
    }
    return 0;
}

std::string fifoProblem(const RealtimeSettings& settings, int error) {
    return fmt::format("no SCHED_FIFO priority {}: {} (needs CAP_SYS_NICE or LimitRTPRIO)",
                       settings.priority, systemError(error));
}

// Tries the priority with the calling thread, and restores its scheduling.
// @return errno; 0 = allowed
int tryFifo(unsigned priority) {
    sched_param present{};
    int policy = 0;
    pthread_getschedparam(pthread_self(), &policy, &present);
    sched_param wanted{};
    wanted.sched_priority = static_cast<int>(priority);
    const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &wanted);
    if (error == 0) pthread_setschedparam(pthread_self(), policy, &present);
    return error;
}

}  // namespace

void prepareProcess() {
    // Keeps touched memory in the process (mallopt(3)).
    mallopt(M_TRIM_THRESHOLD, -1);
    mallopt(M_MMAP_MAX, 0);
    mallopt(M_ARENA_MAX, 1);
    // The default of 8 MB of locked stack for each of roscpp's threads would be most of the
    // executor's memory.
    pthread_attr_t attributes;
    pthread_attr_init(&attributes);
    pthread_attr_setstacksize(&attributes, kThreadStack);
    pthread_setattr_default_np(&attributes);
    pthread_attr_destroy(&attributes);
    (void)processCpus();  // before any thread is restricted
}

RealtimeProblems lockMemory(const RealtimeSettings& settings) {
    RealtimeProblems problems;
    if (settings.lock_memory) {
        if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
            problems.push_back(
                {fmt::format(
                     "memory is not locked: {} (needs CAP_IPC_LOCK or LimitMEMLOCK=infinity)",
                     systemError(errno)),
                 true});
        }
        dl_iterate_phdr(&releaseTextTables, nullptr);
        UnlockedMemory::ofProcess().unlock();
    } else {
        munlockall();
        problems.push_back({"memory is not locked: the runner's lock_memory is off", false});
    }
    prefaultHeap(settings.heap_bytes);
    return problems;
}

RealtimeProblems checkScheduling(const RealtimeSettings& settings) {
    RealtimeProblems problems;
    if (const int error = tryFifo(settings.priority); error != 0) {
        problems.push_back({fifoProblem(settings, error), true});
    }
    std::ifstream realtime_kernel("/sys/kernel/realtime");
    if (realtime_kernel.get() != '1') {
        problems.push_back(
            {"the kernel is not PREEMPT_RT: latency is not bounded (Debian: linux-image-rt-amd64)",
             false});
    }
    return problems;
}

RealtimeAttributes::RealtimeAttributes(const RealtimeSettings& settings) {
    pthread_attr_init(&attributes_);
    pthread_attr_setstacksize(&attributes_, settings.stack_bytes + kStackReserve + kThreadStack);
    if (!settings.wanted) return;
    if (tryFifo(settings.priority) == 0) {
        sched_param wanted{};
        wanted.sched_priority = static_cast<int>(settings.priority);
        pthread_attr_setinheritsched(&attributes_, PTHREAD_EXPLICIT_SCHED);
        pthread_attr_setschedpolicy(&attributes_, SCHED_FIFO);
        pthread_attr_setschedparam(&attributes_, &wanted);
    }
    cpu_set_t cpus;
    CPU_ZERO(&cpus);
    CPU_SET(settings.cpu, &cpus);
    pthread_attr_setaffinity_np(&attributes_, sizeof cpus, &cpus);
}

RealtimeProblems applyToThread(pthread_t thread, const RealtimeSettings& settings) {
    RealtimeProblems problems;
    sched_param wanted{};
    wanted.sched_priority = static_cast<int>(settings.priority);
    if (const int error = pthread_setschedparam(thread, SCHED_FIFO, &wanted); error != 0) {
        problems.push_back({fifoProblem(settings, error), true});
    }
    cpu_set_t cpus;
    CPU_ZERO(&cpus);
    CPU_SET(settings.cpu, &cpus);
    if (const int error = pthread_setaffinity_np(thread, sizeof cpus, &cpus); error != 0) {
        problems.push_back(
            {fmt::format("cannot run on CPU {}: {}", settings.cpu, systemError(error)), true});
    }
    return problems;
}

__attribute__((noinline)) void prefaultStack(std::size_t bytes) {
    // In steps, because one large frame could skip the guard page.
    constexpr std::size_t kStep = 16 * 1024;
    std::array<unsigned char, kStep> block{};
    // Keeps the compiler from omitting the writes.
    asm volatile("" : : "r"(block.data()) : "memory");
    if (bytes > kStep) prefaultStack(bytes - kStep);
    asm volatile("" : : "r"(block.data()) : "memory");  // and from making a tail call
}

IdleStateGuard::IdleStateGuard() : fd_(::open("/dev/cpu_dma_latency", O_WRONLY | O_CLOEXEC)) {
    const std::int32_t microseconds = 0;
    if (fd_ < 0 || ::write(fd_, &microseconds, sizeof microseconds) != sizeof microseconds) {
        problem_ = fmt::format("idle states are not limited: /dev/cpu_dma_latency: {}",
                               systemError(errno));
    }
}

IdleStateGuard::~IdleStateGuard() {
    if (fd_ >= 0) ::close(fd_);
}

}  // namespace rtcf::executor
