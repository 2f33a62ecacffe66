#include "ros/calls/host_names.hpp"

#include <arpa/inet.h>
#include <netdb.h>
#include <xmlrpcpp/XmlRpcSocket.h>

#include <array>
#include <condition_variable>
#include <map>
#include <mutex>

#include "ros/threads/quiet_thread.hpp"

namespace rtcf::ros1 {

namespace {

constexpr auto kRetryAfter = std::chrono::seconds(10);  // after a failed or doubtful look-up

std::string lookUpHost(const std::string& host) {
    addrinfo hints{};
    hints.ai_family = XmlRpc::XmlRpcSocket::s_use_ipv6_ ? AF_UNSPEC : AF_INET;
    hints.ai_socktype = SOCK_STREAM;
    addrinfo* found = nullptr;
    if (getaddrinfo(host.c_str(), nullptr, &hints, &found) != 0) return {};
    std::array<char, NI_MAXHOST> text{};
    const bool done = getnameinfo(found->ai_addr, found->ai_addrlen, text.data(), text.size(),
                                  nullptr, 0, NI_NUMERICHOST) == 0;
    freeaddrinfo(found);
    return done ? text.data() : std::string();
}

bool isNumeric(const std::string& host) {
    in6_addr address{};
    return inet_pton(AF_INET, host.c_str(), &address) == 1 ||
           inet_pton(AF_INET6, host.c_str(), &address) == 1;
}

}  // namespace

struct HostNames::Shared {
    struct Host {
        std::string address;  // empty = unknown
        bool looking = false;
        std::chrono::steady_clock::time_point last;
    };
    std::mutex mutex;
    std::condition_variable changed;
    std::map<std::string, Host> hosts;
};

HostNames::HostNames() : shared_(std::make_shared<Shared>()) {}

std::optional<std::string> HostNames::address(const std::string& host,
                                              std::chrono::milliseconds patience) {
    if (isNumeric(host)) return host;
    {
        const std::lock_guard lock(shared_->mutex);
        const auto known = shared_->hosts.find(host);
        if (known != shared_->hosts.end() && !known->second.address.empty())
            return known->second.address;
    }
    doubt(host);
    std::unique_lock lock(shared_->mutex);
    const Shared::Host& known = shared_->hosts[host];
    shared_->changed.wait_for(lock, patience, [&] { return !known.looking; });
    if (known.address.empty()) return std::nullopt;
    return known.address;
}

void HostNames::doubt(const std::string& host) {
    {
        const std::lock_guard lock(shared_->mutex);
        const bool is_new = shared_->hosts.count(host) == 0;
        Shared::Host& known = shared_->hosts[host];
        const auto now = std::chrono::steady_clock::now();
        if (isNumeric(host) || known.looking || (!is_new && now < known.last + kRetryAfter)) return;
        known.looking = true;
        known.last = now;
    }
    // A look-up cannot be cancelled, so its thread is detached; later calls use its result.
    quietThread("ros-resolve", [shared = shared_, host] {
        std::string address = lookUpHost(host);
        {
            const std::lock_guard lock(shared->mutex);
            Shared::Host& known = shared->hosts[host];
            known.looking = false;
            if (!address.empty()) known.address = std::move(address);
        }
        shared->changed.notify_all();
    }).detach();
}

}  // namespace rtcf::ros1
