#include "loop/cpu_claim.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <system_error>

namespace rtcf::executor {

const std::vector<int>& processCpus() {
    static const std::vector<int> cpus = [] {
        cpu_set_t allowed;
        CPU_ZERO(&allowed);
        sched_getaffinity(0, sizeof allowed, &allowed);
        std::vector<int> found;
        for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
            if (CPU_ISSET(cpu, &allowed)) found.push_back(cpu);
        }
        return found;
    }();
    return cpus;
}

void keepThreadsOff(int cpu, int except) {
    cpu_set_t others;
    CPU_ZERO(&others);
    for (const int each : processCpus()) {
        if (each != cpu) CPU_SET(each, &others);
    }
    if (CPU_COUNT(&others) == 0) return;
    std::error_code gone;  // a thread that ends meanwhile
    for (const auto& task : std::filesystem::directory_iterator("/proc/self/task", gone)) {
        const auto thread = static_cast<pid_t>(std::stol(task.path().filename()));
        if (thread != except) sched_setaffinity(thread, sizeof others, &others);
    }
}

CpuClaim::CpuClaim(int wanted, std::string names) : names_(std::move(names)) {
    if (wanted >= 0) {
        take(wanted);
        return;
    }
    const std::vector<int>& cpus = processCpus();
    if (std::any_of(cpus.rbegin(), cpus.rend(), [this](int cpu) { return take(cpu); })) return;
    if (!cpus.empty()) cpu_ = cpus.back();
}

CpuClaim::~CpuClaim() {
    if (fd_ >= 0) ::close(fd_);
}

bool CpuClaim::take(int cpu) {
    cpu_ = cpu;
    const std::string name = names_ + "-" + std::to_string(cpu);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    // A zero, then the name: it stands in no folder.
    std::copy(name.begin(), name.end(), address.sun_path + 1);
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
    const int fd = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (fd < 0) return false;
    if (::bind(fd, reinterpret_cast<const sockaddr*>(&address), size) != 0) {
        ::close(fd);
        return false;
    }
    fd_ = fd;
    return true;
}

}  // namespace rtcf::executor
