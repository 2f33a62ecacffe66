#include "realtime/cpu_claim.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <sstream>

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

CpuClaim::CpuClaim(int wanted, std::string folder) : folder_(std::move(folder)) {
    constexpr int kMost = 100;  // most loops counted per CPU
    std::vector<int> cpus{wanted};
    if (wanted < 0) {
        std::string isolated;
        std::getline(std::ifstream("/sys/devices/system/cpu/isolated"), isolated);
        cpus = byPreference(processCpus(), isolated);
    }
    if (!cpus.empty()) cpu_ = cpus.front();
    for (int place = 0; place < kMost && !folder_.empty(); ++place) {
        if (std::any_of(cpus.begin(), cpus.end(), [&](int cpu) { return take(cpu, place); }))
            return;
    }
}

CpuClaim::~CpuClaim() {
    if (fd_ < 0) return;
    // Removed while it is locked, so that no other process holds it.
    ::unlink(file_.c_str());
    ::close(fd_);
}

bool CpuClaim::take(int cpu, int place) {
    constexpr int kMostTries = 100;  // for a file that is removed again and again
    std::string file = folder_ + "/cpu-" + std::to_string(cpu);
    if (place > 0) file += "-" + std::to_string(place);
    for (int i = 0; i < kMostTries; ++i) {
        // Not readable by others, because any reader of a file can lock it.
        const int fd = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
        if (fd < 0) return false;
        struct stat locked{};
        struct stat named{};
        if (::flock(fd, LOCK_EX | LOCK_NB) != 0 || ::fstat(fd, &locked) != 0) {
            ::close(fd);
            return false;
        }
        // Its last owner may have removed it between open() and flock().
        if (::stat(file.c_str(), &named) == 0 && named.st_ino == locked.st_ino &&
            named.st_dev == locked.st_dev) {
            fd_ = fd;
            file_ = std::move(file);
            cpu_ = cpu;
            place_ = place;
            return true;
        }
        ::close(fd);
    }
    return false;
}

}  // namespace rtcf::executor
