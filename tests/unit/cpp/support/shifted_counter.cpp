#include "support/shifted_counter.hpp"

#if defined(__x86_64__)

#include <elf.h>
#include <link.h>
#include <sys/auxv.h>
#include <sys/prctl.h>
#include <ucontext.h>
#include <x86intrin.h>

#include <csignal>
#include <cstring>

namespace rtcf::test {

namespace {

std::int64_t shift_ticks = 0;
std::uintptr_t vdso_begin = 0;
std::uintptr_t vdso_end = 0;
struct sigaction previous{};

void findVdso() {
    vdso_begin = getauxval(AT_SYSINFO_EHDR);
    if (vdso_begin == 0) return;
    // NOLINTBEGIN(performance-no-int-to-ptr): the kernel returns addresses as numbers
    const auto* const header = reinterpret_cast<const ElfW(Ehdr)*>(vdso_begin);
    const auto* segment = reinterpret_cast<const ElfW(Phdr)*>(vdso_begin + header->e_phoff);
    // NOLINTEND(performance-no-int-to-ptr)
    for (int i = 0; i < header->e_phnum; ++i, ++segment) {
        if (segment->p_type == PT_LOAD) vdso_end = vdso_begin + segment->p_vaddr + segment->p_memsz;
    }
}

// Emulates the trapped instruction: RDTSC, or RDTSCP without the processor number, which the
// vdso's clocks ignore.
void readForIt(int signal, siginfo_t* /*info*/, void* context) {
    auto& registers = static_cast<ucontext_t*>(context)->uc_mcontext.gregs;
    const auto at = static_cast<std::uintptr_t>(registers[REG_RIP]);
    // NOLINTNEXTLINE(performance-no-int-to-ptr): a register is a number
    const auto* const code = reinterpret_cast<const unsigned char*>(at);
    const bool rdtsc = code[0] == 0x0f && code[1] == 0x31;
    const bool rdtscp = code[0] == 0x0f && code[1] == 0x01 && code[2] == 0xf9;
    if (!rdtsc && !rdtscp) {
        ::sigaction(signal, &previous, nullptr);  // a real crash
        return;
    }
    prctl(PR_SET_TSC, PR_TSC_ENABLE, 0, 0, 0);
    std::uint64_t ticks = __rdtsc();
    prctl(PR_SET_TSC, PR_TSC_SIGSEGV, 0, 0, 0);
    if (at < vdso_begin || at >= vdso_end) ticks += static_cast<std::uint64_t>(shift_ticks);
    registers[REG_RAX] = static_cast<greg_t>(ticks & 0xffff'ffff);
    registers[REG_RDX] = static_cast<greg_t>(ticks >> 32);
    registers[REG_RIP] += rdtsc ? 2 : 3;
}

}  // namespace

ShiftedCounter::ShiftedCounter() {
    findVdso();
    struct sigaction action{};
    action.sa_sigaction = &readForIt;
    action.sa_flags = SA_SIGINFO | SA_ONSTACK;
    sigemptyset(&action.sa_mask);
    ::sigaction(SIGSEGV, &action, &previous);
}

ShiftedCounter::~ShiftedCounter() { ::sigaction(SIGSEGV, &previous, nullptr); }

bool ShiftedCounter::possible() noexcept {
#if defined(__SANITIZE_ADDRESS__) && __GNUC__ >= 14
    return false;  // a trap ends the process there, before the handler runs
#else
    int mode = 0;
    return prctl(PR_GET_TSC, &mode, 0, 0, 0) == 0;
#endif
}

void ShiftedCounter::shift(std::int64_t ticks) noexcept {
    shift_ticks = ticks;
    prctl(PR_SET_TSC, PR_TSC_SIGSEGV, 0, 0, 0);
}

}  // namespace rtcf::test

#else

namespace rtcf::test {

ShiftedCounter::ShiftedCounter() = default;
ShiftedCounter::~ShiftedCounter() = default;
bool ShiftedCounter::possible() noexcept { return false; }
void ShiftedCounter::shift(std::int64_t /*ticks*/) noexcept {}

}  // namespace rtcf::test

#endif
