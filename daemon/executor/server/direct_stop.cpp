#include "server/direct_stop.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <pthread.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <system_error>

#include "common/time_units.hpp"
#include "realtime/cycle_counter.hpp"

namespace rtcf::executor {

namespace {

constexpr std::int64_t kLineTimeout = kSecond;        // from the connection to the request line
constexpr std::int64_t kAnswerTimeout = 2 * kSecond;  // from the request to the end of the loop
// From the request to the removal of the mark on disk.
constexpr std::int64_t kDiskTimeout = 3 * kSecond / 10;
constexpr int kLookMs = 2;                // ms between checks of a stopping loop
constexpr std::size_t kMostClients = 32;  // clients with the right; others are disconnected at once
constexpr std::size_t kLongestLine = 64;
// Users without the right get an answer; the folder excludes all others.
constexpr mode_t kSocketMode = 0660;

void answer(int fd, const std::string& text) {
    const std::string line = text + "\n";
    // Does not wait for a client that does not read.
    [[maybe_unused]] const ssize_t sent =
        ::send(fd, line.data(), line.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
}

std::vector<gid_t> groupsOf(int fd, gid_t primary) {
    std::vector<gid_t> groups(256);
    auto size = static_cast<socklen_t>(groups.size() * sizeof(gid_t));
    if (::getsockopt(fd, SOL_SOCKET, SO_PEERGROUPS, groups.data(), &size) != 0) {
        if (errno != ERANGE) return {primary};
        groups.resize(size / sizeof(gid_t));
        if (::getsockopt(fd, SOL_SOCKET, SO_PEERGROUPS, groups.data(), &size) != 0)
            return {primary};
    }
    groups.resize(size / sizeof(gid_t));
    groups.push_back(primary);
    return groups;
}

}  // namespace

v1::DirectStop directStopTo(const DirectStopReport& report) {
    v1::DirectStop message;
    message.set_count(report.count);
    message.set_uid(report.user);
    message.set_pid(report.pid);
    message.set_at_ns(report.at_ns);
    return message;
}

DirectStop::DirectStop(std::string path, std::string mark, const Access& access)
    : mark_(std::move(mark)), access_(access) {
    if (path.empty()) return;
    listener_.emplace(std::move(path), 256, kSocketMode);
    wake_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (wake_ < 0) throw std::system_error(errno, std::generic_category(), "eventfd");
}

DirectStop::~DirectStop() {
    close();
    if (listener_) ::close(wake_);
}

void DirectStop::serve(Stoppable what) {
    if (!listener_) return;
    what_ = std::move(what);
    thread_ = std::thread([this] { threadMain(); });
}

void DirectStop::close() noexcept {
    if (!thread_.joinable()) return;
    ending_.store(true);
    const std::uint64_t one = 1;
    [[maybe_unused]] const ssize_t count = ::write(wake_, &one, sizeof one);
    thread_.join();
}

DirectStopReport DirectStop::last() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return last_;
}

void DirectStop::threadMain() {
    pthread_setname_np(pthread_self(), "rtcf-stop");
    while (!ending_.load()) {
        const bool waits = std::any_of(clients_.begin(), clients_.end(),
                                       [](const Client& client) { return client.asked; });
        std::vector<pollfd> polled{{wake_, POLLIN, 0}, {listener_->fd(), listener_->events(), 0}};
        const bool full = polled[1].events == 0;
        // Clients that only connect must not block others.
        if (clients_.size() >= kMostClients) polled[1].events = 0;
        for (const Client& client : clients_)
            polled.push_back({client.asked ? -1 : client.fd, POLLIN, 0});  // no further requests
        const int at_most_ms = clients_.empty() && !full ? 1000 : 100;
        ::poll(polled.data(), polled.size(), waits ? kLookMs : at_most_ms);
        if ((polled[1].revents & POLLIN) != 0) accept();
        const std::uint64_t before = last().count;
        for (std::size_t i = clients_.size(); i-- > 0;) {
            if (attend(clients_[i])) continue;
            ::close(clients_[i].fd);
            clients_.erase(clients_.begin() + static_cast<std::ptrdiff_t>(i));
        }
        // Not before all waiting requests are counted: who sees the loop stopped and starts it must
        // not be rejected because of one of them.
        if (last().count != before) {
            what_.stop();
            mark_.remove();
        }
        listener_->renew(monotonicNow());
    }
    for (const Client& client : clients_) {
        if (client.asked) answer(client.fd, "stopped: the executor ends");
        ::close(client.fd);
    }
    clients_.clear();
}

void DirectStop::accept() {
    for (std::size_t i = clients_.size(); i < kMostClients; ++i) {
        const int fd = listener_->accept();
        if (fd < 0) return;
        admit(fd);
    }
}

void DirectStop::admit(int fd) {
    ucred peer{};
    socklen_t size = sizeof peer;
    if (::getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0) {
        ::close(fd);
        return;
    }
    // Checks the right at once, before reading, so that clients without it cost little.
    if (const Right has = access_.of(peer.uid, groupsOf(fd, peer.gid)); has < Right::Operate) {
        answer(fd, fmt::format("refused: stop requires the right `operate`, but user {} has {}",
                               peer.uid, has == Right::None ? "none" : wordOf(has)));
        ::close(fd);
        return;
    }
    clients_.push_back({fd, peer.uid, peer.pid, false, monotonicNow() + kLineTimeout, 0, {}});
}

bool DirectStop::attend(Client& client) {
    if (client.asked) {
        if (!what_.running()) return !answerStopped(client);
        if (monotonicNow() < client.until_ns) return true;
        answer(client.fd,
               "late: a component does not return from update(): the loop ends when it does, "
               "or the executor after stall_timeout");
        return false;
    }
    std::array<char, kLongestLine> buffer{};
    const ssize_t count = ::recv(client.fd, buffer.data(), buffer.size(), 0);
    if (count < 0) return (errno == EAGAIN || errno == EINTR) && monotonicNow() < client.until_ns;
    client.text.append(buffer.data(), static_cast<std::size_t>(count));
    if (client.text.find('\n') == std::string::npos)
        return count > 0 && client.text.size() <= kLongestLine;
    if (client.text != "stop\n") {
        answer(client.fd, "refused: the only request here is `stop`");
        return false;
    }
    countStop(client);
    client.asked = true;
    client.until_ns = monotonicNow() + kAnswerTimeout;
    client.saved_until_ns = monotonicNow() + kDiskTimeout;
    return true;
}

bool DirectStop::answerStopped(const Client& client) const {
    const auto [done, problem] = mark_.last();
    if (!done && monotonicNow() < client.saved_until_ns) return false;
    if (!done) {
        answer(client.fd, "stopped: not saved yet: the disk of the state folder does not answer");
    } else if (!problem.empty()) {
        answer(client.fd, "stopped: not saved: " + problem);
    } else {
        answer(client.fd, "stopped");
    }
    return true;
}

void DirectStop::countStop(const Client& client) {
    const std::lock_guard<std::mutex> lock(mutex_);
    last_ = {last_.count + 1, client.user, client.pid, monotonicNow()};
}

}  // namespace rtcf::executor
