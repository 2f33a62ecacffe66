// Forbids its thread all system calls except the wait for the next cycle, and those that
// end a thread: the kernel then kills the process at any other one. Needs no permission
// (seccomp(2)).
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <ctime>
#include <rtcf/component.hpp>

namespace {

constexpr std::uint32_t kWords = 2;  // per argument, the lower one first

constexpr sock_filter load(std::size_t offset) {
    return BPF_STMT(BPF_LD | BPF_W | BPF_ABS, static_cast<std::uint32_t>(offset));
}
constexpr sock_filter answer(std::uint32_t verdict) { return BPF_STMT(BPF_RET | BPF_K, verdict); }
// Continues with the next instruction if equal, else skips `leave_out` of them.
constexpr sock_filter unlessEqual(std::uint32_t value, std::uint8_t leave_out) {
    return BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, value, 0, leave_out);
}
constexpr std::size_t argument(std::size_t index) {
    return offsetof(seccomp_data, args) + index * kWords * sizeof(std::uint32_t);
}

class Sealed final : public rtcf::Component {
    rtcf::Output<double> sealed{this, "sealed"};

    void update() override {
        if (sealed.value() == 0.0) sealed.value() = seal() ? 1.0 : -1.0;
        sealed.publish();
    }

    static bool seal() {
        static const std::array filter{
            load(offsetof(seccomp_data, nr)),
            unlessEqual(SYS_clock_nanosleep, 5),
            load(argument(0)),
            unlessEqual(CLOCK_MONOTONIC, 3),
            load(argument(1)),
            unlessEqual(TIMER_ABSTIME, 1),
            answer(SECCOMP_RET_ALLOW),
            load(offsetof(seccomp_data, nr)),
            unlessEqual(SYS_sigaltstack, 1),
            answer(SECCOMP_RET_ALLOW),
            unlessEqual(SYS_rt_sigprocmask, 1),
            answer(SECCOMP_RET_ALLOW),
            unlessEqual(SYS_madvise, 1),
            answer(SECCOMP_RET_ALLOW),
            unlessEqual(SYS_exit, 1),
            answer(SECCOMP_RET_ALLOW),
            answer(SECCOMP_RET_KILL_PROCESS),
        };
        const sock_fprog program{filter.size(), const_cast<sock_filter*>(filter.data())};
        return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
               prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program, 0, 0) == 0;
    }
};

}  // namespace

RTCF_COMPONENT(Sealed, "Restricts the real-time thread to the system call that waits")
