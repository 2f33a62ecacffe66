#include "server/server.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <system_error>
#include <utility>

#include "common/serialized.hpp"
#include "common/thrown.hpp"
#include "common/time_units.hpp"
#include "messages/errors.hpp"
#include "messages/from_wire.hpp"
#include "messages/known_values.hpp"
#include "messages/settings_messages.hpp"
#include "messages/to_wire.hpp"
#include "realtime/cycle_counter.hpp"
#include "rtcf/version.hpp"
#include "server/change.hpp"

namespace rtcf::executor {

namespace pb = ::rtcf::v1;

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
    entry.time_ns = realtimeNow();
    entry.message = fmt::format("{} log records were dropped: no rtcfd read them in time", count);
    v1::Response response;
    *response.mutable_log() = logTo(entry);
    return response;
}

// Protocol version. The newer side of rtcfd and executor uses only requests that the older one
// knows, see link.py of rtcfd. Hello, stop and exit never change.
constexpr std::uint32_t kProtocol = 4;
constexpr std::int64_t kProbeDeadline = kSecond / 2;

// The answer to a change that the loop has adopted: valid even if hooks of components that have
// left do not return.
struct AdoptedChange {
    std::atomic<bool> known{false};  // after it, the answer does not change
    v1::Response answer;
};

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

// Tells all rtcfd of a direct stop.
void Server::tellStops() {
    std::vector<std::uint64_t> gone;
    for (const auto& [id, connection] : connections_) {
        if (!tellStop(*connection)) gone.push_back(id);
    }
    for (const std::uint64_t id : gone) drop(id);
}

// Called before each message, since a message may show a state after the stop: rtcfd then takes
// requests that the executor would reject as older than the stop.
// @return false if the peer has disconnected
bool Server::tellStop(Connection& connection) {
    if (exiting_ || !connection.greeted()) return true;
    const DirectStopReport report = direct_stop_->last();
    if (connection.toldStops() == report.count) return true;
    connection.setToldStops(report.count);
    v1::Response response;
    *response.mutable_direct_stop() = directStopTo(report);
    return connection.send(serialized(response));
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
        ::poll(polled.data(), polled.size(), patience_ms);
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
        expire();
        reportStuck();
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
}

void Server::respond(std::uint64_t connection, const v1::Response& response) {
    std::size_t size = response.ByteSizeLong();
    std::string message;
    if (size <= Connection::kLargestFrame) {
        message = serialized(response);
        size = message.size();  // may be larger, as it has valid texts only
    }
    if (size > Connection::kLargestFrame) {
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
    if (found == connections_.end()) return;
    if (!tellStop(*found->second) || !found->second->send(message)) drop(connection);
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
    tellStops();
}

void Server::expire() {
    const std::int64_t now = monotonicNow();
    const RunningHook hook = stuck();
    for (auto it = waiting_.begin(); it != waiting_.end();) {
        // A slow change may continue; it is given up only if a hook hangs.
        const bool change = it->second.given_up != nullptr;
        const bool stopped = it->second.stop && !runner_->loop().running();
        if ((now < it->second.until_ns && !stopped) || (change && hook.component.empty())) {
            ++it;
            continue;
        }
        if (change) it->second.given_up->store(true);
        const std::uint64_t connection = it->first.first;
        v1::Response response = it->second.otherwise(hook);
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

// The hook that has taken too long.
RunningHook Server::stuck() const {
    RunningHook hook = runner_->recorder().runningHook();
    if (hook.component.empty()) return {};
    const std::int64_t limit_ns = runner_->status().settings.hook_timeout_ns;
    return monotonicNow() - hook.since_ns > limit_ns ? hook : RunningHook{};
}

// Reports each hook once, as nobody may ask.
void Server::reportStuck() {
    const RunningHook hook = stuck();
    if (hook.component.empty() || hook.since_ns == reported_stuck_ns_) return;
    reported_stuck_ns_ = hook.since_ns;
    log_->write(LogLevel::Error, hook.component, stuckText(hook));
}

std::string Server::stuckText(const RunningHook& hook) const {
    return fmt::format(
        "stuck in {1}() for {2} s: `rtcfctl runner restart {0}` ends this hook and the loop, and "
        "loads the saved graph again; `rtcfctl -r {0} unload --force {3}` also removes {3} from it",
        runner_->name(), hook.name(), (monotonicNow() - hook.since_ns) / kSecond, hook.component);
}

void Server::requireNotStuck() const {
    if (const RunningHook hook = stuck(); !hook.component.empty())
        throw Error(ErrorKind::HookStuck,
                    fmt::format("runner {} is {}", runner_->name(), stuckText(hook)));
}

void Server::handle(Connection& connection, const v1::Request& request) {
    const std::uint64_t id = connection.id();
    if (request.kind_case() == v1::Request::kHello) {
        v1::Response response;
        response.set_id(request.id());
        v1::HelloResult& hello = *response.mutable_hello();
        hello.set_protocol(kProtocol);
        hello.set_version(RTCF_VERSION);
        hello.set_runner(runner_->name());
        hello.set_pid(::getpid());
        hello.set_flight_recorder_fd(runner_->recorder().fd());
        hello.set_frames_fd(runner_->frameMemory().fd());
        hello.set_unconfigured(!configured_);
        if (const DirectStopReport report = direct_stop_->last(); report.count != 0) {
            *hello.mutable_direct_stop() = directStopTo(report);
            connection.setToldStops(report.count);
        }
        connection.setGreeted();
        respond(id, response);
        return;
    }
    if (!connection.greeted()) {
        respond(id, errorResponse(request.id(), ErrorKind::FailedPrecondition,
                                  "the first request must be hello"));
        return;
    }
    try {
        requireKnownValues(request);
        if (answerQuery(id, request)) return;
        if (request.kind_case() == v1::Request::kGetComponent) {
            submitProbe(id, request);
        } else if (request.kind_case() == v1::Request::kWatchPorts) {
            beginWatch(id, request);
        } else {
            submitChange(id, request);
        }
    } catch (const Error& error) {
        respond(id, errorResponse(request.id(), error.kind(), error.what()));
    }
}

bool Server::answerQuery(std::uint64_t connection, const v1::Request& request) {
    v1::Response response;
    response.set_id(request.id());
    const std::shared_ptr<const GraphView> graph = runner_->graph();
    switch (request.kind_case()) {
        case v1::Request::kListComponents: {
            const RunnerState state = runner_->status().state;
            auto& result = *response.mutable_components();
            for (std::size_t i = 0; i < graph->components.size(); ++i) {
                *result.add_components() = componentTo(*graph, i, state);
            }
            break;
        }
        case v1::Request::kListConnections:
            *response.mutable_connections() = connectionsTo(*graph);
            break;
        case v1::Request::kGetStatistics:
            *response.mutable_statistics() =
                statistics_->statistics(request.get_statistics().buckets());
            break;
        case v1::Request::kResetStatistics:
            statistics_->restart();
            response.mutable_done();
            break;
        case v1::Request::kGetStatus:
            setState(response, runner_->numberedState());
            *response.mutable_status() = status();
            break;
        case v1::Request::kServiceAnswer:
            calls_.answer(request.service_answer().call(),
                          {request.service_answer().success(), request.service_answer().message()});
            response.mutable_done();
            break;
        case v1::Request::kAccess:
            access_->set(rulesFrom(request.access()));
            response.mutable_done();
            break;
        case v1::Request::kEndWatch: {
            const auto id = std::make_pair(connection, request.end_watch().watch());
            waiting_.erase(id);
            if (const std::uint64_t watch = ports_.end(id); watch != 0) endWatches({watch});
            response.mutable_done();
            break;
        }
        case v1::Request::kEndStep: {
            const auto step = waiting_.find({connection, request.end_step().step()});
            if (step != waiting_.end() && step->second.endless())
                step->second.given_up->store(true);
            response.mutable_done();
            break;
        }
        case v1::Request::kExit:
            response.mutable_done();
            exiting_ = true;
            break;
        default:
            return false;
    }
    respond(connection, response);
    return true;
}

void Server::submitChange(std::uint64_t connection, const v1::Request& request) {
    const std::uint64_t id = request.id();
    // A stop never waits behind a hook.
    if (request.kind_case() == v1::Request::kStop) runner_->requestStop();
    if (request.kind_case() != v1::Request::kStop) requireNotStuck();
    requireStopsKnown(request);
    // Statistics belong to one run of the loop, which begins here.
    const bool begins = request.kind_case() == v1::Request::kStart ||
                        (request.kind_case() == v1::Request::kReplay && request.replay().begin()) ||
                        ((request.kind_case() == v1::Request::kStep ||
                          request.kind_case() == v1::Request::kRestoreSnapshot) &&
                         runner_->status().state != RunnerState::Stepping);
    if (begins && !runner_->loop().running()) statistics_->restart();
    // Steps and replays have no time limit; they report progress.
    const bool endless =
        request.kind_case() == v1::Request::kStep || request.kind_case() == v1::Request::kReplay;
    const auto given_up = std::make_shared<std::atomic<bool>>(false);
    const bool stop = request.kind_case() == v1::Request::kStop;
    const auto adopted = std::make_shared<AdoptedChange>();
    const auto otherwise = [this, id, stop, adopted](const RunningHook& hook) {
        const std::string why = fmt::format("runner {} is {}", runner_->name(), stuckText(hook));
        if (adopted->known.load()) {
            v1::Response response = adopted->answer;
            response.mutable_change()->add_notes(why);
            return response;
        }
        if (stop && runner_->loop().running()) {
            return errorResponse(id, ErrorKind::Unavailable,
                                 "the loop does not reach the end of its cycle, and " + why);
        }
        return errorResponse(id, ErrorKind::HookStuck,
                             stop ? "the loop has ended, but " + why : why);
    };
    const std::int64_t limit_ns = runner_->status().settings.hook_timeout_ns;
    waiting_[{connection, id}] = {endless ? INT64_MAX : monotonicNow() + limit_ns, otherwise,
                                  given_up, stop};
    if (const RunningHook hook = runner_->recorder().runningHook();
        stop && !hook.component.empty()) {
        v1::Response step;
        step.set_id(id);
        step.set_progress(
            fmt::format("the loop ends; the stop() of its components waits for {}()", hook.name()));
        respond(connection, step);
    }
    runner_->post([this, connection, id, request, given_up, endless, adopted] {
        v1::Response response;
        response.set_id(id);
        // If the request was given up, the caller has already received an error. A stop is carried
        // out anyway.
        const auto require_wanted = [&] {
            if (!given_up->load() || request.kind_case() == v1::Request::kStop) return;
            throw Error(ErrorKind::Unavailable,
                        "given up: the caller has disconnected, or a hook took too long");
        };
        try {
            require_wanted();
            requireStopsKnown(request);
            const auto progress = [this, connection, id, endless,
                                   &require_wanted](const std::string& line) {
                if (!endless) require_wanted();  // endless ones pause by themselves
                v1::Response step;
                step.set_id(id);
                step.set_progress(line);
                post(connection, std::move(step), false);
            };
            if (request.kind_case() == v1::Request::kConfigure) {
                runner_->configure(settingsFrom(request.configure(), runner_->settings()));
                configured_ = true;
                *response.mutable_status() = status();
            } else if (request.kind_case() == v1::Request::kLimits) {
                runner_->limitTaps(request.limits().taps());
                response.mutable_done();
            } else if (request.kind_case() == v1::Request::kReplay) {
                *response.mutable_replay() =
                    replayTo(runner_->replay(replayFrom(request.replay()), progress));
            } else if (request.kind_case() == v1::Request::kDescribeInput) {
                const auto& input = request.describe_input();
                *response.mutable_input_type() = inputTypeTo(
                    runner_->writableInput(fullNameOf(input.component()), input.port()));
            } else if (request.kind_case() == v1::Request::kTakeSnapshot) {
                *response.mutable_snapshot() = snapshotTo(runner_->takeSnapshot());
            } else {
                *response.mutable_change() =
                    outcomeTo(change(*runner_, request, progress, *given_up));
                adopted->answer = response;
                setState(adopted->answer, runner_->numberedState());
                adopted->known = true;
                runner_->cleanUpLeft();
            }
        } catch (const Error& error) {
            response = errorResponse(id, error.kind(), error.what());
        } catch (const std::exception& error) {
            response = errorResponse(id, ErrorKind::FailedPrecondition, textOf(error));
        } catch (...) {
            response = errorResponse(id, ErrorKind::FailedPrecondition, "an unknown exception");
        }
        setState(response, runner_->numberedState());
        log_->drain();  // sends log records of hooks before the answer
        post(connection, std::move(response), true);
    });
}

// Rejects a request to run the loop if it was made before the last direct stop.
void Server::requireStopsKnown(const v1::Request& request) const {
    const bool runs = request.kind_case() == v1::Request::kStart ||
                      request.kind_case() == v1::Request::kStep ||
                      request.kind_case() == v1::Request::kRestoreSnapshot ||
                      request.kind_case() == v1::Request::kReplay;
    const DirectStopReport report = direct_stop_->last();
    if (!runs || request.direct_stops() >= report.count) return;
    throw Error(ErrorKind::LoopStopped,
                fmt::format("runner {} was stopped at its executor by user {} after this "
                            "request: ask again",
                            runner_->name(), report.user));
}

// Answers GetComponent. The graph view has the component; only values need the graph thread, and
// are omitted if it is busy.
void Server::submitProbe(std::uint64_t connection, const v1::Request& request) {
    const std::string name = fullNameOf(request.get_component().component());
    const std::uint64_t id = request.id();
    const std::shared_ptr<const GraphView> graph = runner_->graph();
    const RunnerState state = runner_->status().state;
    const auto found =
        std::find_if(graph->components.begin(), graph->components.end(),
                     [&](const auto& component) { return component->full_name == name; });
    if (found == graph->components.end()) {
        (void)graph->get(name);  // throws
    }
    v1::Response response;
    response.set_id(id);
    *response.mutable_component() =
        componentTo(*graph, static_cast<std::size_t>(found - graph->components.begin()), state);
    waiting_[{connection, id}] = {monotonicNow() + kProbeDeadline,
                                  [response](const RunningHook&) { return response; }, nullptr};
    runner_->post([this, connection, name, response]() mutable {
        try {
            addValues(*response.mutable_component(), runner_->probe(name));
            addStates(*response.mutable_component(), runner_->states(name));
        } catch (const std::exception&) {
            // Unloaded meanwhile: answer with the earlier graph view.
        }
        post(connection, std::move(response), true);
    });
}

// Begins a stream. Values begin when the graph thread has made the loop keep them.
void Server::beginWatch(std::uint64_t connection, const v1::Request& request) {
    requireNotStuck();
    const std::uint64_t id = request.id();
    const std::uint64_t watch = next_watch_++;
    const pb::WatchPortsRequest& asked = request.watch_ports();
    if (asked.component_times() && asked.min_max()) {
        throw Error(ErrorKind::InvalidArgument,
                    "component_times are available per cycle, not per window: request min_max "
                    "without component_times");
    }
    const auto& patterns = asked.selection();
    const Watch wanted{PortSelection({patterns.begin(), patterns.end()}), asked.component_times()};
    ports_.begin({connection, id}, watch, wanted, asked.every(), asked.min_max());
    const auto nothing = [id](const RunningHook&) {
        return errorResponse(id, ErrorKind::Unavailable, "the stream has ended");
    };
    waiting_[{connection, id}] = {INT64_MAX, nothing, nullptr};
    const bool allow_missing = request.watch_ports().allow_missing();
    runner_->post([this, connection, id, watch, wanted, allow_missing] {
        try {
            runner_->watch(watch, wanted, allow_missing);
        } catch (const Error& error) {
            post(connection, errorResponse(id, error.kind(), error.what()), true);
        } catch (const std::exception& error) {
            post(connection, errorResponse(id, ErrorKind::FailedPrecondition, textOf(error)), true);
        }
    });
}

void Server::endWatches(const std::vector<std::uint64_t>& watches) {
    for (const std::uint64_t watch : watches)
        runner_->post([this, watch] { runner_->endWatch(watch); });
}

pb::RunnerStatus Server::status() const {
    const RunnerStatus present = runner_->status();
    const std::shared_ptr<const GraphView> graph = runner_->graph();
    const Loop& loop = runner_->loop();
    pb::RunnerStatus status;
    status.set_runner(runner_->name());
    // The graph thread, which notes the end of a loop, may be in a hook.
    const bool ended = present.state == RunnerState::Running && !loop.running();
    status.set_state(stateTo(ended ? RunnerState::Stopped : present.state));
    status.set_status(present.loop_fault);
    status.set_simulated(present.simulated);
    status.set_clock_silence(present.clock_silence);
    if (const RunningHook hook = stuck(); !hook.component.empty()) {
        status.set_state(pb::RUNNER_STATE_STUCK);
        status.set_status(stuckText(hook));
        pb::HookStuck& stuck = *status.mutable_stuck();
        stuck.set_component(hook.component);
        stuck.set_hook(hookName(hook.hook));
        stuck.set_duration_s(static_cast<double>(monotonicNow() - hook.since_ns) / 1e9);
        stuck.set_in_graph(std::any_of(graph->components.begin(), graph->components.end(),
                                       [&](const auto& each) { return each->slot == hook.slot; }));
    }
    *status.mutable_settings() = settingsTo(present.settings);
    status.set_pid(::getpid());
    status.set_realtime_tid(loop.threadId());
    if (loop.cpu() >= 0) status.set_loop_cpu(loop.cpu());
    statistics_->addTo(status, *graph);
    status.set_components(static_cast<std::uint32_t>(graph->components.size()));
    status.set_generation(graph->generation);
    std::uint64_t faults = 0;
    for (const auto& component : graph->components)
        faults += component->statistics->faults.count.value();
    status.set_faults(faults);
    for (const std::string& line : present.degraded) status.add_degraded(line);
    pb::RosStatus& ros = *status.mutable_ros();
    ros.set_enabled(present.bridge.enabled);
    ros.set_connected(present.bridge.connected);
    ros.set_node(present.bridge.node);
    ros.set_master_uri(present.bridge.master_uri);
    ros.set_publications(present.bridge.publications);
    ros.set_subscriptions(present.bridge.subscriptions);
    ros.set_problem(present.bridge.problem);
    ros.set_killed(present.bridge.killed);
    ros.set_too_large(present.too_large);
    std::uint64_t passed_over = 0;
    for (const auto& injector : graph->injectors) passed_over += injector->passedOver();
    ros.set_passed_over(passed_over);
    return status;
}

}  // namespace rtcf::executor
