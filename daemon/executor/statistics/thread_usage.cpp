#include "statistics/thread_usage.hpp"

#include <fstream>
#include <sstream>
#include <string>

namespace rtcf::executor {

ThreadUsage readThreadUsage(int thread_id) {
    ThreadUsage usage;
    if (thread_id == 0) return usage;
    const std::string folder = "/proc/self/task/" + std::to_string(thread_id);
    std::string line;
    std::getline(std::ifstream(folder + "/stat"), line);
    // The thread's name, in parentheses, may contain any character; field 3 follows it.
    if (const std::size_t end = line.rfind(')'); end != std::string::npos) {
        std::istringstream fields(line.substr(end + 1));
        std::string skipped;
        for (int field = 3; field < 10; ++field) fields >> skipped;
        std::uint64_t children = 0;
        fields >> usage.minor_faults >> children >> usage.major_faults;
    }
    std::ifstream status(folder + "/status");
    const std::string key = "nonvoluntary_ctxt_switches:";
    while (std::getline(status, line)) {
        if (line.rfind(key, 0) == 0)
            usage.involuntary_switches = std::stoull(line.substr(key.size()));
    }
    return usage;
}

}  // namespace rtcf::executor
