#include "realtime/cpu_claim.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
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

std::vector<int> byPreference(const std::vector<int>& cpus, const std::string& isolated) {
    std::vector<int> found(cpus.rbegin(), cpus.rend());
    std::stable_partition(found.begin(), found.end(), [&isolated](int cpu) {
        std::istringstream ranges(isolated);
        for (std::string range; std::getline(ranges, range, ',');) {
            std::istringstream numbers(range);
            int first = 0;
            int last = 0;
            char dash = 0;
            if (!(numbers >> first)) continue;
            if (!(numbers >> dash >> last)) last = first;
            if (cpu >= first && cpu <= last) return true;
        }
        return false;
    });
    return found;
}

CpuClaim::CpuClaim(int wanted, std::string names) : names_(std::move(names)) {
    constexpr int kMost = 100;  // loops of one CPU that are counted
    std::vector<int> cpus{wanted};
    if (wanted < 0) {
        std::string isolated;
        std::getline(std::ifstream("/sys/devices/system/cpu/isolated"), isolated);
        cpus = byPreference(processCpus(), isolated);
    }
    for (int place = 0; place < kMost; ++place) {
        if (std::any_of(cpus.begin(), cpus.end(), [&](int cpu) { return take(cpu, place); }))
            return;
    }
    if (!cpus.empty()) cpu_ = cpus.front();
}

CpuClaim::~CpuClaim() {
    if (fd_ >= 0) ::close(fd_);
}

bool CpuClaim::take(int cpu, int place) {
    std::string name = names_ + "-" + std::to_string(cpu);
    if (place > 0) name += "-" + std::to_string(place);
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
    cpu_ = cpu;
    place_ = place;
    return true;
}

}  // namespace rtcf::executor
