#include "ros/roscpp/node_name.hpp"

#include <unistd.h>

#include <array>
#include <climits>

namespace rtcf::ros1 {

namespace {

std::string legal(const std::string& text, const char* if_empty) {
    if (text.empty()) return if_empty;
    std::string name = text;
    for (char& c : name) {
        // Not std::isalnum(), because a locale may allow letters that ROS does not.
        const bool allowed =
            (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
        if (!allowed) c = '_';
    }
    return name;
}

}  // namespace

NodeName nodeName(const std::string& host, const std::string& daemon, const std::string& runner) {
    const std::string below = daemon.empty() ? "" : "/" + legal(daemon, "");
    return {"/rtcfd/" + legal(host, "localhost") + below, legal(runner, "rt_runner")};
}

NodeName nodeNameOf(const std::string& name_space, const NodeName& otherwise) {
    const std::size_t slash = name_space.rfind('/');
    if (slash == std::string::npos || slash + 1 == name_space.size()) return otherwise;
    return {name_space.substr(0, slash), name_space.substr(slash + 1)};
}

NodeName nodeName(const std::string& daemon, const std::string& runner) {
    std::array<char, HOST_NAME_MAX + 1> host{};
    if (gethostname(host.data(), host.size() - 1) != 0) host[0] = '\0';
    return nodeName(host.data(), daemon, runner);
}

}  // namespace rtcf::ros1
