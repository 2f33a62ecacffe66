#include "ros/master/listener.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <sstream>

namespace rtcf::ros1 {

namespace {

// The format of /proc/net/tcp: words in the machine's byte order, in capitals.
std::string hexadecimal(const void* bytes, std::size_t words) {
    std::string text;
    for (std::size_t i = 0; i < words; ++i) {
        std::uint32_t word = 0;
        std::memcpy(&word, static_cast<const char*>(bytes) + i * sizeof word, sizeof word);
        std::array<char, 9> digits{};
        std::snprintf(digits.data(), digits.size(), "%08X", word);
        text += digits.data();
    }
    return text;
}

// The user of the socket that listens at one of the addresses, in one of the kernel's tables.
std::optional<uid_t> ownerIn(const char* table, std::initializer_list<std::string> addresses,
                             std::uint32_t port) {
    constexpr const char* kListening = "0A";
    std::array<char, 6> digits{};
    std::snprintf(digits.data(), digits.size(), ":%04X", port & 0xFFFFU);
    std::ifstream file(table);
    std::string line;
    std::getline(file, line);  // the heading
    while (std::getline(file, line)) {
        std::istringstream fields(line);
        std::string number;
        std::string local;
        std::string remote;
        std::string state;
        std::string queues;
        std::string timer;
        std::string retries;
        uid_t owner = 0;
        if (!(fields >> number >> local >> remote >> state >> queues >> timer >> retries >> owner))
            continue;
        if (state != kListening) continue;
        for (const std::string& address : addresses) {
            if (local == address + digits.data()) return owner;
        }
    }
    return std::nullopt;
}

}  // namespace

bool isOfThisMachine(const std::string& address) {
    sockaddr_storage storage{};
    socklen_t size = 0;
    auto& four = reinterpret_cast<sockaddr_in&>(storage);
    auto& six = reinterpret_cast<sockaddr_in6&>(storage);
    if (inet_pton(AF_INET, address.c_str(), &four.sin_addr) == 1) {
        // All of 127/8 is local, even if it cannot be bound.
        if (ntohl(four.sin_addr.s_addr) >> 24U == 127U) return true;
        four.sin_family = AF_INET;
        size = sizeof four;
    } else if (inet_pton(AF_INET6, address.c_str(), &six.sin6_addr) == 1) {
        six.sin6_family = AF_INET6;
        size = sizeof six;
    } else {
        return false;
    }
    const int probe = socket(storage.ss_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (probe < 0) return false;
    // Only addresses of this machine can be bound.
    const bool ours = bind(probe, reinterpret_cast<sockaddr*>(&storage), size) == 0;
    close(probe);
    return ours;
}

std::optional<uid_t> ownerOfListener(const MasterAddress& server) {
    if (!isOfThisMachine(server.address)) return std::nullopt;
    const std::string any_six(32, '0');
    in_addr four{};
    in6_addr six{};
    if (inet_pton(AF_INET, server.address.c_str(), &four) == 1) {
        // The kernel prefers the most specific match.
        const std::string exact = hexadecimal(&four, 1);
        if (auto owner = ownerIn("/proc/net/tcp", {exact}, server.port)) return owner;
        if (auto owner =
                ownerIn("/proc/net/tcp6", {"0000000000000000FFFF0000" + exact}, server.port))
            return owner;
        if (auto owner = ownerIn("/proc/net/tcp", {"00000000"}, server.port)) return owner;
        return ownerIn("/proc/net/tcp6", {any_six}, server.port);
    }
    if (inet_pton(AF_INET6, server.address.c_str(), &six) != 1) return std::nullopt;
    if (auto owner = ownerIn("/proc/net/tcp6", {hexadecimal(&six, 4)}, server.port)) return owner;
    return ownerIn("/proc/net/tcp6", {any_six}, server.port);
}

}  // namespace rtcf::ros1
