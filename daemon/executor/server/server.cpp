#include "server/server.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <system_error>

#include "messages/errors.hpp"
#include "messages/to_wire.hpp"

namespace rtcf::executor {

namespace {

// Longer than rtcfd takes for one change and those queued before it.
constexpr std::chrono::seconds kAskTimeout{70};
constexpr std::size_t kLargestOutbox = 10000;  // most messages kept while no rtcfd is connected
constexpr std::size_t kLargestConnections = 8;
constexpr int kBacklog = 8;
constexpr int kPortsInterval = 20;                                // ms between batches of values
constexpr std::size_t kMostPorts = std::size_t{4} * 1024 * 1024;  // most bytes queued for a reader

[[noreturn]] void fail(const std::string& what) {
    throw std::system_error(errno, std::generic_category(), what);
}

int takeSignals() {
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGTERM);
    sigaddset(&set, SIGINT);
    pthread_sigmask(SIG_BLOCK, &set, nullptr);
    const int fd = ::signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK);
    if (fd < 0) fail("signalfd");
    return fd;
}

// The peer must be our own user, or root.
bool trusted(int fd) {
    ucred peer{};
    socklen_t size = sizeof peer;
    return ::getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0 &&
           (peer.uid == ::geteuid() || peer.uid == 0);
}

v1::Response lostRecords(std::uint64_t count) {
    LogEntry entry;
    entry.level = LogLevel::Warn;
    entry.time_ns =
        std::chrono::nanoseconds(std::chrono::system_clock::now().time_since_epoch()).count();
    entry.message = fmt::format("{} log records were dropped: no rtcfd read them in time", count);
    v1::Response response;
    *response.mutable_log() = logTo(entry);
    return response;
}

}  // namespace

Server::Server(const std::string& socket_path)
    : listener_(socket_path, kBacklog),
      signals_(takeSignals()),
      wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    if (wake_ < 0) fail("eventfd");
}

Server::~Server() {
    connections_.clear();
    ::close(wake_);
    ::close(signals_);
}

void Server::post(std::uint64_t connection, v1::Response response, bool last) {
    {
        const std::lock_guard<std::mutex> lock(outbox_mutex_);
        // Answers and events are few, so they are never dropped.
        if (response.has_log() && outbox_.size() >= kLargestOutbox) {
            ++lost_records_;
            return;
        }
        outbox_.push_back({connection, std::move(response), last});
    }
    wakeUp();
}

void Server::wakeUp() const {
    const std::uint64_t one = 1;
    // If the counter is full, the thread is already awake.
    [[maybe_unused]] const ssize_t count = ::write(wake_, &one, sizeof one);
}

void Server::publish(const LogEntry& entry) {
    v1::Response response;
    *response.mutable_log() = logTo(entry);
    post(0, std::move(response), false);
}

void Server::publish(const RunnerEvent& event) {
    v1::Response response;
    if (event.kind == RunnerEvent::Kind::ParametersChanged) {
        v1::ParametersChanged& changed = *response.mutable_parameters_changed();
        changed.set_component(event.component);
        for (const std::string& name : event.parameters) changed.add_parameters(name);
    } else {
        *response.mutable_event() = eventTo(event);
    }
    setState(response, event.state);
    post(0, std::move(response), false);
}

OutsideAnswer Server::ask(const OutsideCall& call, const std::atomic<bool>& cancel) {
    const std::uint64_t number = calls_.begin();
    v1::Response response;
    *response.mutable_service_call() = callTo(number, call);
    post(0, std::move(response), false);
    return calls_.wait(number, kAskTimeout, cancel);
}

// Sends a call to one rtcfd only, the last one connected, so that it is not carried out twice.
void Server::handOn(const v1::Response& call) {
    const std::uint64_t number = call.service_call().call();
    for (auto each = connections_.rbegin(); each != connections_.rend(); ++each) {
        if (!each->second->greeted()) continue;
        const std::uint64_t id = each->first;
        calls_.sent(number, id);
        respond(id, call);
        return;
    }
    calls_.answer(number, {false, "no rtcfd is connected to this executor: is it running?"});
}

void Server::publish(const DirectStopReport& report) {
    v1::Response response;
    *response.mutable_direct_stop() = directStopTo(report);
    post(0, std::move(response), false);
}

void Server::serve(Runner& runner, Log& log, Access& access, const DirectStop& direct_stop) {
    runner_ = &runner;
    log_ = &log;
    access_ = &access;
    direct_stop_ = &direct_stop;
    statistics_ = std::make_unique<StatisticsReport>(runner, log);
    runner.onReadersAwaited([this] { wakeUp(); });
    while (!exiting_) {
        std::vector<pollfd> polled{
            {listener_.fd(), listener_.events(), 0}, {signals_, POLLIN, 0}, {wake_, POLLIN, 0}};
        std::vector<std::uint64_t> ids;
        for (const auto& [id, connection] : connections_) {
            const short events = connection->wantsWrite() ? POLLIN | POLLOUT : POLLIN;
            polled.push_back({connection->fd(), events, 0});
            ids.push_back(id);
        }
        const int patience_ms = waiting_.empty() ? 1000 : kPortsInterval;
        ::poll(polled.data(), polled.size(), resets_.empty() ? patience_ms : 1);
        if ((polled[1].revents & POLLIN) != 0) exiting_ = true;
        if ((polled[2].revents & POLLIN) != 0) {
            std::uint64_t count = 0;
            [[maybe_unused]] const ssize_t size = ::read(wake_, &count, sizeof count);
        }
        for (std::size_t i = 0; i < ids.size(); ++i) {
            const auto found = connections_.find(ids[i]);
            if (found == connections_.end()) continue;
            const short events = polled[i + 3].revents;
            if ((events & POLLOUT) != 0 && !found->second->flush()) {
                drop(ids[i]);
            } else if ((events & (POLLIN | POLLHUP | POLLERR)) != 0) {
                receive(*found->second);
            }
        }
        if ((polled[0].revents & POLLIN) != 0) accept();
        deliver();
        servePorts();
        goOnWithResets();
        expire();
        listener_.renew(monotonicNow());
        if (orphaned()) exiting_ = true;
    }
    runner.onReadersAwaited({});
    runner.requestStop();
}

// True if no rtcfd, which could stop the loop, has been connected for too long.
bool Server::orphaned() {
    const bool anybody = std::any_of(connections_.begin(), connections_.end(),
                                     [](const auto& entry) { return entry.second->greeted(); });
    if (anybody || !had_daemon_) {
        alone_since_ns_ = monotonicNow();
        had_daemon_ = had_daemon_ || anybody;
        return false;
    }
    return monotonicNow() - alone_since_ns_ >= runner_->status().settings.orphan_timeout_ns;
}

void Server::accept() {
    const int fd = listener_.accept();
    if (fd < 0) return;
    if (!trusted(fd) || connections_.size() >= kLargestConnections) {
        ::close(fd);
        return;
    }
    const std::uint64_t id = next_id_++;
    connections_.emplace(id, std::make_unique<Connection>(fd, id));
}

void Server::receive(Connection& connection) {
    const std::uint64_t id = connection.id();
    std::vector<v1::Request> requests;
    const bool alive = connection.receive(requests);
    for (const v1::Request& request : requests) {
        if (connections_.count(id) == 0) return;
        handle(connection, request);
    }
    if (!alive) drop(id);
}

void Server::drop(std::uint64_t id) {
    connections_.erase(id);
    calls_.lost(id);
    endWatches(ports_.endAll(id));
    for (auto it = waiting_.begin(); it != waiting_.end();) {
        const bool of_it = it->first.first == id;
        if (of_it && it->second.endless()) it->second.given_up->store(true);
        it = of_it ? waiting_.erase(it) : std::next(it);
    }
    // Resets of other connections continue; if there are none, counting resumes.
    const auto gone = std::remove_if(resets_.begin(), resets_.end(),
                                     [id](const Reset& each) { return each.connection == id; });
    if (gone == resets_.end()) return;
    resets_.erase(gone, resets_.end());
    if (resets_.empty()) runner_->holdStatistics(false);
}

void Server::respond(std::uint64_t connection, const v1::Response& response) {
    if (const std::size_t size = response.ByteSizeLong(); size > Connection::kLargestFrame) {
        // rtcfd would close the connection, reconnect and repeat the request.
        const std::string kind = v1::Response::descriptor()
                                     ->FindFieldByNumber(static_cast<int>(response.kind_case()))
                                     ->name();
        const std::string text = fmt::format(
            "{} of runner {} take {} bytes; the limit is {}: spread its components over more "
            "runners, or give them smaller values",
            kind, runner_->name(), size, Connection::kLargestFrame);
        if (response.id() == 0) {
            log_->write(LogLevel::Error, {}, text);
        } else {
            respond(connection, errorResponse(response.id(), ErrorKind::ResourceExhausted, text));
        }
        return;
    }
    const auto found = connections_.find(connection);
    if (found != connections_.end() && !found->second->send(response)) drop(connection);
}

// Sends messages from other threads. Unsolicited messages wait for a connection.
void Server::deliver() {
    std::deque<Outgoing> outgoing;
    const bool anybody = std::any_of(connections_.begin(), connections_.end(),
                                     [](const auto& entry) { return entry.second->greeted(); });
    {
        const std::lock_guard<std::mutex> lock(outbox_mutex_);
        if (anybody) {
            outgoing.swap(outbox_);
            if (lost_records_ != 0) outgoing.push_back({0, lostRecords(lost_records_), false});
            lost_records_ = 0;
        } else {
            // Without a connection, only answers, which are discarded, and calls, which cannot
            // wait.
            std::deque<Outgoing> kept;
            for (Outgoing& message : outbox_) {
                const bool now = message.connection != 0 || message.response.has_service_call();
                (now ? outgoing : kept).push_back(std::move(message));
            }
            outbox_.swap(kept);
        }
    }
    for (Outgoing& message : outgoing) {
        if (message.connection != 0) {
            const auto request = std::make_pair(message.connection, message.response.id());
            if (waiting_.count(request) == 0) continue;  // given up, or the connection has ended
            if (message.last) {
                waiting_.erase(request);
                ports_.end(request);  // a rejected stream
            }
            respond(message.connection, message.response);
            continue;
        }
        if (message.response.has_service_call()) {
            handOn(message.response);
            continue;
        }
        std::vector<std::uint64_t> ids;
        for (const auto& [id, connection] : connections_) {
            if (connection->greeted()) ids.push_back(id);
        }
        for (const std::uint64_t id : ids) respond(id, message.response);
    }
}

void Server::expire() {
    const std::int64_t now = monotonicNow();
    for (auto it = waiting_.begin(); it != waiting_.end();) {
        // A slow change may continue; it is given up only if a hook hangs.
        const bool change = it->second.given_up != nullptr;
        if (now < it->second.until_ns || (change && stuck().empty())) {
            ++it;
            continue;
        }
        if (change) it->second.given_up->store(true);
        const std::uint64_t connection = it->first.first;
        v1::Response response = it->second.otherwise();
        it = waiting_.erase(it);
        respond(connection, response);
        if (connections_.count(connection) == 0) return;  // drop() has changed waiting_
    }
}

void Server::servePorts() {
    const auto room = [this](const PortStreams::Id& id) {
        const auto found = connections_.find(id.first);
        return found != connections_.end() && found->second->waiting() < kMostPorts;
    };
    const auto send = [this, &room](const PortStreams::Id& id, const v1::Response& response) {
        respond(id.first, response);
        return room(id);
    };
    std::vector<PortStreams::Table> done = ports_.serve(runner_->takeFrameTables(), room, send);
    if (!done.empty()) runner_->post([done = std::move(done)]() mutable { done.clear(); });
}

}  // namespace rtcf::executor
