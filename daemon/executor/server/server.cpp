#include "server/server.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <system_error>

#include "messages/convert.hpp"
#include "messages/image_file.hpp"
#include "rtcf/version.hpp"
#include "statistics/thread_usage.hpp"

namespace rtcf::executor {

namespace pb = ::rtcf::v1;

namespace {

// Of rtcfd and executor the newer asks for nothing that the older does not know:
// see link.py of rtcfd. Hello, stop and exit stay as they are for good.
constexpr std::uint32_t kProtocol = 4;
constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::int64_t kHookTimeout = 10 * kSecond;
constexpr std::int64_t kProbeTimeout = kSecond / 2;
// Longer than rtcfd takes for one change, those before it included.
constexpr std::chrono::seconds kAskTimeout{70};
constexpr std::size_t kLargestOutbox = 10000;  // messages kept while no daemon is connected
constexpr std::size_t kLargestConnections = 8;
constexpr int kBacklog = 8;
constexpr int kPortsInterval = 20;  // ms between batches of values
constexpr std::size_t kMostPorts =
    std::size_t{4} * 1024 * 1024;  // bytes that wait for their reader

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

v1::Response errorResponse(std::uint64_t id, RefusalKind kind, const std::string& message) {
    v1::Response response;
    response.set_id(id);
    *response.mutable_error() = errorTo(kind, message);
    return response;
}

v1::Response lostRecords(std::uint64_t count) {
    LogEntry entry;
    entry.level = LogLevel::Warn;
    entry.time_ns =
        std::chrono::nanoseconds(std::chrono::system_clock::now().time_since_epoch()).count();
    entry.message = fmt::format("{} log records were lost: no daemon took them in time", count);
    v1::Response response;
    *response.mutable_log() = logTo(entry);
    return response;
}

void setDistribution(pb::Distribution& message, const DistributionSummary& summary) {
    message.set_count(summary.count);
    message.set_min_ns(summary.min);
    message.set_mean_ns(summary.mean);
    message.set_p50_ns(summary.p50);
    message.set_p99_ns(summary.p99);
    message.set_p999_ns(summary.p999);
    message.set_max_ns(summary.max);
}

pb::RunnerState stateTo(RunnerState state) {
    switch (state) {
        case RunnerState::Running:
            return pb::RUNNER_STATE_RUNNING;
        case RunnerState::Faulted:
            return pb::RUNNER_STATE_FAULTED;
        case RunnerState::Stuck:
            return pb::RUNNER_STATE_STUCK;
        case RunnerState::Stepping:
            return pb::RUNNER_STATE_STEPPING;
        case RunnerState::Stopped:
            break;
    }
    return pb::RUNNER_STATE_STOPPED;
}

// The state that a message was made in.
void setState(v1::Response& response, const NumberedState& state) {
    response.set_state(stateTo(state.state));
    response.set_state_number(state.number);
}

}  // namespace

Server::Server(const std::string& socket_path)
    : path_(socket_path),
      listener_(socket_path, kBacklog),
      signals_(takeSignals()),
      wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    if (wake_ < 0) fail("eventfd");
}

Server::~Server() {
    connections_.clear();
    ::close(wake_);
    ::close(signals_);
    ::unlink(path_.c_str());
}

void Server::post(std::uint64_t connection, v1::Response response, bool last) {
    {
        const std::lock_guard<std::mutex> lock(outbox_mutex_);
        // Answers and events always have room: there are few of them.
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
    // Full means that it is awake already.
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

// To one daemon, the one that came last: nothing is to be done twice.
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
    runner.onFramesWaiting([this] { wakeUp(); });
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
        if (orphaned()) exiting_ = true;
    }
    runner.onFramesWaiting({});
    runner.requestStop();
}

// No daemon for too long: nobody is left who could stop this loop.
bool Server::orphaned() {
    const bool anybody = std::any_of(connections_.begin(), connections_.end(),
                                     [](const auto& entry) { return entry.second->greeted(); });
    if (anybody || !had_daemon_) {
        alone_since_ns_ = monotonicNow();
        had_daemon_ = had_daemon_ || anybody;
        return false;
    }
    return monotonicNow() - alone_since_ns_ >= runner_->picture().settings.orphan_timeout_ns;
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
    for (auto it = waiting_.begin(); it != waiting_.end();)
        it = it->first.first == id ? waiting_.erase(it) : std::next(it);
    // Those of others are gone on with; if there are none, the figures go on.
    const auto gone = std::remove_if(resets_.begin(), resets_.end(),
                                     [id](const Reset& each) { return each.connection == id; });
    if (gone == resets_.end()) return;
    resets_.erase(gone, resets_.end());
    if (resets_.empty()) runner_->holdFigures(false);
}

void Server::respond(std::uint64_t connection, const v1::Response& response) {
    if (const std::size_t size = response.ByteSizeLong(); size > Connection::kLargestFrame) {
        // The daemon would hang up on it, and ask for the same when it is connected again.
        const std::string kind = v1::Response::descriptor()
                                     ->FindFieldByNumber(static_cast<int>(response.kind_case()))
                                     ->name();
        const std::string text = fmt::format(
            "{} of runner {} take {} bytes, {} at most: spread its components over more runners, "
            "or give them smaller values",
            kind, runner_->name(), size, Connection::kLargestFrame);
        if (response.id() == 0) {
            log_->write(LogLevel::Error, {}, text);
        } else {
            respond(connection, errorResponse(response.id(), RefusalKind::ResourceExhausted, text));
        }
        return;
    }
    const auto found = connections_.find(connection);
    if (found != connections_.end() && !found->second->send(response)) drop(connection);
}

// Sends what other threads have posted. Unasked messages wait for somebody to send them to.
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
            // Answers that nobody waits for, and calls, which cannot wait.
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
            if (waiting_.count(request) == 0) continue;  // given up on, or its daemon has gone
            if (message.last) {
                waiting_.erase(request);
                ports_.end(request);  // one that is refused
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
        // A change that is slow is waited for; it is given up if a hook hangs.
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

std::string Server::stuck() const {
    const auto [activity, since_ns] = runner_->activity();
    return !activity.empty() && monotonicNow() - since_ns > kHookTimeout ? activity : std::string();
}

void Server::requireNotStuck() const {
    const std::string where = stuck();
    if (where.empty()) return;
    throw Refusal(RefusalKind::Unavailable,
                  fmt::format("runner {} is stuck in {}(): only stop and restart it",
                              runner_->name(), where));
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
        if (const DirectStopReport report = direct_stop_->last(); report.count != 0)
            *hello.mutable_direct_stop() = directStopTo(report);
        connection.setGreeted();
        respond(id, response);
        return;
    }
    if (!connection.greeted()) {
        respond(id, errorResponse(request.id(), RefusalKind::FailedPrecondition,
                                  "the first request must be hello"));
        return;
    }
    try {
        if (answerQuery(id, request)) return;
        if (request.kind_case() == v1::Request::kGetComponent) {
            submitProbe(id, request);
        } else if (request.kind_case() == v1::Request::kWatchPorts) {
            beginWatch(id, request);
        } else {
            submitChange(id, request);
        }
    } catch (const Refusal& refusal) {
        respond(id, errorResponse(request.id(), refusal.kind(), refusal.what()));
    }
}

bool Server::answerQuery(std::uint64_t connection, const v1::Request& request) {
    v1::Response response;
    response.set_id(request.id());
    const std::shared_ptr<const GraphSnapshot> graph = runner_->snapshot();
    switch (request.kind_case()) {
        case v1::Request::kListComponents: {
            const RunnerState state = runner_->picture().state;
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
            *response.mutable_statistics() = statistics();
            break;
        case v1::Request::kResetStatistics:
            resetStatistics(connection, request.id());
            return true;
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
    // Stop never queues behind a hook.
    if (request.kind_case() == v1::Request::kStop) runner_->requestStop();
    if (request.kind_case() != v1::Request::kStop) requireNotStuck();
    requireStopsKnown(request);
    // Statistics are of one run of the loop, which has not begun yet.
    const bool begins = request.kind_case() == v1::Request::kStart ||
                        (request.kind_case() == v1::Request::kReplay && request.replay().begin()) ||
                        ((request.kind_case() == v1::Request::kStep ||
                          request.kind_case() == v1::Request::kRestoreSnapshot) &&
                         runner_->picture().state != RunnerState::Stepping);
    if (begins && !runner_->loop().running() && !takeBaseline()) {
        setBaseline(figures(*runner_->snapshot()));  // in a step, which this one waits for
    }
    // Steps take as long as they take; they report progress.
    const bool endless =
        request.kind_case() == v1::Request::kStep || request.kind_case() == v1::Request::kReplay;
    const auto given_up = std::make_shared<std::atomic<bool>>(false);
    const auto otherwise = [this, id] {
        return errorResponse(id, RefusalKind::Unavailable,
                             fmt::format("runner {} is stuck in {}()", runner_->name(), stuck()));
    };
    waiting_[{connection, id}] = {endless ? INT64_MAX : monotonicNow() + kHookTimeout, otherwise,
                                  given_up};
    runner_->post([this, connection, id, request, given_up] {
        v1::Response response;
        response.set_id(id);
        // Whoever asked has been told that it did not happen. Stop is another matter.
        const auto require_wanted = [&] {
            if (!given_up->load() || request.kind_case() == v1::Request::kStop) return;
            throw Refusal(RefusalKind::Unavailable, "given up: a hook took too long");
        };
        try {
            require_wanted();
            requireStopsKnown(request);
            const auto progress = [this, connection, id, &require_wanted](const std::string& line) {
                require_wanted();
                v1::Response step;
                step.set_id(id);
                step.set_progress(line);
                post(connection, std::move(step), false);
            };
            if (request.kind_case() == v1::Request::kConfigure) {
                runner_->configure(settingsFrom(request.configure(), runner_->settings()));
                *response.mutable_status() = status();
            } else if (request.kind_case() == v1::Request::kLimits) {
                runner_->limitTaps(request.limits().taps());
                response.mutable_done();
            } else if (request.kind_case() == v1::Request::kReplay) {
                *response.mutable_replay() =
                    replayTo(runner_->replay(replayFrom(request.replay()), progress));
            } else if (request.kind_case() == v1::Request::kTakeSnapshot) {
                *response.mutable_snapshot() = snapshotTo(runner_->takeImage());
            } else {
                *response.mutable_change() = outcomeTo(change(request, progress));
            }
        } catch (const Refusal& refusal) {
            response = errorResponse(id, refusal.kind(), refusal.what());
        } catch (const std::exception& error) {
            response = errorResponse(id, RefusalKind::FailedPrecondition, error.what());
        } catch (...) {
            response = errorResponse(id, RefusalKind::FailedPrecondition, "an unknown exception");
        }
        setState(response, runner_->numberedState());
        log_->drain();  // what the hooks said comes before the answer
        post(connection, std::move(response), true);
    });
}

// What was asked for before somebody stopped the loop past rtcfd does not run it again.
void Server::requireStopsKnown(const v1::Request& request) const {
    const bool runs = request.kind_case() == v1::Request::kStart ||
                      request.kind_case() == v1::Request::kStep ||
                      request.kind_case() == v1::Request::kRestoreSnapshot ||
                      request.kind_case() == v1::Request::kReplay;
    const DirectStopReport report = direct_stop_->last();
    if (!runs || request.direct_stops() >= report.count) return;
    throw Refusal(RefusalKind::LoopStopped,
                  fmt::format("runner {} was stopped at its executor by user {} after this was "
                              "asked for: ask again",
                              runner_->name(), report.user));
}

// What rtcfd says about the folder that it found a library in.
template <typename Message>
void Server::trustOwnerOf(const Message& message) {
    if (message.has_owner()) runner_->trust(message.owner());
}

ChangeOutcome Server::change(const v1::Request& request, const Runner::Progress& progress) {
    switch (request.kind_case()) {
        case v1::Request::kStart:
            return runner_->start(progress);
        case v1::Request::kStop:
            return runner_->stop(progress);
        case v1::Request::kStep:
            if (request.step().cycles() == 0)
                throw Refusal(RefusalKind::InvalidArgument, "0 cycles to step: name a number");
            return runner_->step(request.step().cycles(), progress);
        case v1::Request::kLoad: {
            trustOwnerOf(request.load());
            ComponentDefinition definition = definitionFrom(request.load().component());
            for (auto& [name, value] : parametersFrom(request.load().inherited()))
                definition.inherited.push_back({name, value});
            return runner_->load(std::move(definition), request.load().library(), progress);
        }
        case v1::Request::kUnload: {
            std::vector<std::string> names;
            for (const std::string& name : request.unload().components())
                names.push_back(fullNameOf(name));
            return runner_->unload(names, progress);
        }
        case v1::Request::kReplace: {
            trustOwnerOf(request.replace());
            const std::string name = fullNameOf(request.replace().component());
            for (const auto& component : runner_->snapshot()->components) {
                if (component->full_name != name) continue;
                return runner_->replace(
                    name, replacementFrom(request.replace().replacement(), component->definition),
                    request.replace().library(), request.replace().reset_parameters(), progress);
            }
            throw Refusal(RefusalKind::NotFound, fmt::format("no component {} to replace", name));
        }
        case v1::Request::kApply: {
            std::vector<WantedComponent> wanted;
            for (const v1::Load& load : request.apply().components()) {
                trustOwnerOf(load);
                wanted.push_back({definitionFrom(load.component()), load.library(), load.anew()});
            }
            return runner_->apply(wanted, request.apply().dry_run(), progress);
        }
        case v1::Request::kSetBreaks: {
            std::vector<std::pair<std::string, std::string>> ports;
            for (const pb::PortName& port : request.set_breaks().ports()) {
                ports.emplace_back(fullNameOf(port.component()), port.port());
            }
            return runner_->setBreaks(ports, request.set_breaks().broken());
        }
        case v1::Request::kRestoreSnapshot:
            return runner_->restore(imageFromFile(request.restore_snapshot().snapshot()), progress);
        case v1::Request::kResetState:
            return runner_->reset(fullNameOf(request.reset_state().component()));
        case v1::Request::kSetState:
            return runner_->setStates(fullNameOf(request.set_state().component()),
                                      parametersFrom(request.set_state().states()));
        case v1::Request::kSetParameters:
            return runner_->setParameters(fullNameOf(request.set_parameters().component()),
                                          parametersFrom(request.set_parameters().parameters()));
        default:
            throw Refusal(RefusalKind::RequestMalformed,
                          "a request of unknown kind: is rtcfd newer than its executor?");
    }
}

// A component's picture is at hand; only its ports' values need the graph thread, and are left
// out if that is busy.
void Server::submitProbe(std::uint64_t connection, const v1::Request& request) {
    const std::string name = fullNameOf(request.get_component().component());
    const std::uint64_t id = request.id();
    const std::shared_ptr<const GraphSnapshot> graph = runner_->snapshot();
    const RunnerState state = runner_->picture().state;
    const auto found =
        std::find_if(graph->components.begin(), graph->components.end(),
                     [&](const auto& component) { return component->full_name == name; });
    if (found == graph->components.end()) {
        (void)graph->get(name);  // refuses
    }
    v1::Response response;
    response.set_id(id);
    *response.mutable_component() =
        componentTo(*graph, static_cast<std::size_t>(found - graph->components.begin()), state);
    waiting_[{connection, id}] = {monotonicNow() + kProbeTimeout, [response] { return response; },
                                  nullptr};
    runner_->post([this, connection, name, response]() mutable {
        try {
            addValues(*response.mutable_component(), runner_->probe(name));
            addStates(*response.mutable_component(), runner_->states(name));
        } catch (const std::exception&) {
            // Unloaded since: the picture of a moment ago is still an answer.
        }
        post(connection, std::move(response), true);
    });
}

// Its values begin once the graph thread has the loop keep them.
void Server::beginWatch(std::uint64_t connection, const v1::Request& request) {
    requireNotStuck();
    const std::uint64_t id = request.id();
    const std::uint64_t watch = next_watch_++;
    const auto& patterns = request.watch_ports().selection();
    const PortSelection selection({patterns.begin(), patterns.end()});
    ports_.begin({connection, id}, watch, selection, request.watch_ports().every());
    const auto nothing = [id] {
        return errorResponse(id, RefusalKind::Unavailable, "the stream has ended");
    };
    waiting_[{connection, id}] = {INT64_MAX, nothing, nullptr};
    runner_->post([this, connection, id, watch, selection] {
        try {
            runner_->watch(watch, selection);
        } catch (const Refusal& refusal) {
            post(connection, errorResponse(id, refusal.kind(), refusal.what()), true);
        } catch (const std::exception& error) {
            post(connection, errorResponse(id, RefusalKind::FailedPrecondition, error.what()),
                 true);
        }
    });
}

void Server::endWatches(const std::vector<std::uint64_t>& watches) {
    for (const std::uint64_t watch : watches)
        runner_->post([this, watch] { runner_->endWatch(watch); });
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

pb::RunnerStatus Server::status() const {
    const RunnerPicture picture = runner_->picture();
    const std::shared_ptr<const GraphSnapshot> graph = runner_->snapshot();
    const Loop& loop = runner_->loop();
    pb::RunnerStatus status;
    status.set_runner(runner_->name());
    status.set_state(stateTo(picture.state));
    status.set_status(picture.status);
    status.set_simulated(picture.simulated);
    if (const std::string where = stuck(); !where.empty()) {
        status.set_state(pb::RUNNER_STATE_STUCK);
        status.set_status(fmt::format("stuck in {}()", where));
    }
    *status.mutable_settings() = settingsTo(picture.settings);
    status.set_pid(::getpid());
    status.set_realtime_tid(loop.threadId());
    if (loop.cpu() >= 0) status.set_loop_cpu(loop.cpu());
    status.set_iteration(loop.figures().iteration.load(std::memory_order_relaxed));
    const std::shared_ptr<const Figures> baseline = this->baseline();
    status.set_overruns(loop.figures().overruns.load(std::memory_order_relaxed) -
                        baseline->overruns);
    status.set_missed(loop.figures().missed.load(std::memory_order_relaxed) - baseline->missed);
    status.set_components(static_cast<std::uint32_t>(graph->components.size()));
    status.set_generation(graph->generation);
    std::uint64_t faults = 0;
    for (const auto& component : graph->components)
        faults += component->figures->faults.count.value();
    status.set_faults(faults);
    for (const std::string& line : picture.degraded) status.add_degraded(line);
    pb::RosStatus& ros = *status.mutable_ros();
    ros.set_enabled(picture.bridge.enabled);
    ros.set_connected(picture.bridge.connected);
    ros.set_node(picture.bridge.node);
    ros.set_master_uri(picture.bridge.master_uri);
    ros.set_publications(picture.bridge.publications);
    ros.set_subscriptions(picture.bridge.subscriptions);
    ros.set_problem(picture.bridge.problem);
    ros.set_too_large(picture.too_large);
    std::uint64_t passed_over = 0;
    for (const auto& injector : graph->injectors) passed_over += injector->passedOver();
    ros.set_passed_over(passed_over);
    status.set_log_dropped(log_->dropped() - baseline->log_dropped);
    status.set_tap_dropped(tapDropped(*graph, *baseline));
    return status;
}

// Of the same cycles, unless the loop leaves no time between them.
pb::RunnerStatistics Server::statistics() const {
    const std::shared_ptr<const GraphSnapshot> graph = runner_->snapshot();
    const Loop& loop = runner_->loop();
    const double ns_per_tick = loop.counter().nsPerTick();
    const std::shared_ptr<const Figures> baseline = this->baseline();
    Figures now;
    if (!loop.figures().counting.read([&] { now = figures(*graph); })) now = figures(*graph);
    pb::RunnerStatistics message;
    message.set_runner(runner_->name());
    const HistogramSnapshot duration = difference(now.duration, baseline->duration);
    message.set_iterations(duration.count);
    setDistribution(*message.mutable_duration(), summarize(duration, ns_per_tick));
    setDistribution(*message.mutable_latency(),
                    summarize(difference(now.latency, baseline->latency), 1.0));
    setDistribution(*message.mutable_adoption(),
                    summarize(difference(now.adoption, baseline->adoption), ns_per_tick));
    message.set_overruns(now.overruns - baseline->overruns);
    message.set_missed(now.missed - baseline->missed);
    message.set_late_wake_ups(now.late_wake_ups - baseline->late_wake_ups);
    message.set_exchange_overruns(now.exchange_overruns - baseline->exchange_overruns);
    message.set_catching_up(now.catching_up - baseline->catching_up);
    for (const auto& component : graph->components) {
        pb::ComponentStatistics& statistics = *message.add_components();
        statistics.set_component(component->full_name);
        Figures::Component& present = now.components[component->figures];
        if (const auto found = baseline->components.find(component->figures);
            found != baseline->components.end()) {
            const Figures::Component& past = found->second;
            present.duration = difference(present.duration, past.duration);
            present.overruns -= past.overruns;
            present.device_calls -= past.device_calls;
            present.device_time_ns -= past.device_time_ns;
        }
        setDistribution(*statistics.mutable_duration(), summarize(present.duration, ns_per_tick));
        statistics.set_overruns(present.overruns);
        statistics.set_faults(component->figures->faults.count.value());
        statistics.set_device_calls(present.device_calls);
        if (present.device_calls != 0) {
            statistics.set_device_mean_ns(static_cast<double>(present.device_time_ns) /
                                          static_cast<double>(present.device_calls));
        }
    }
    // The kernel counts of each thread from its beginning.
    const ThreadUsage before = now.thread == baseline->thread ? baseline->usage : ThreadUsage{};
    message.set_minor_faults(now.usage.minor_faults - before.minor_faults);
    message.set_major_faults(now.usage.major_faults - before.major_faults);
    message.set_involuntary_switches(now.usage.involuntary_switches - before.involuntary_switches);
    message.set_log_dropped(now.log_dropped - baseline->log_dropped);
    message.set_tap_dropped(tapDropped(*graph, *baseline));
    return message;
}

std::uint64_t Server::tapDropped(const GraphSnapshot& graph, const Figures& baseline) {
    std::uint64_t dropped = 0;
    for (const auto& tap : graph.taps) {
        const auto found = baseline.tap_dropped.find(tap);
        dropped += tap->dropped() - (found == baseline.tap_dropped.end() ? 0 : found->second);
    }
    return dropped;
}

Server::Figures Server::figures(const GraphSnapshot& graph) const {
    const auto relaxed = std::memory_order_relaxed;
    const LoopFigures& loop = runner_->loop().figures();
    Figures figures;
    for (const auto& component : graph.components) {
        const ComponentFigures& each = *component->figures;
        figures.components[component->figures] = {
            each.duration.snapshot(), each.overruns.load(relaxed), each.device.calls.load(relaxed),
            each.device.time_ns.load(relaxed)};
    }
    figures.duration = loop.duration.snapshot();
    figures.latency = loop.latency.snapshot();
    figures.adoption = loop.adoption.snapshot();
    figures.overruns = loop.overruns.load(relaxed);
    figures.missed = loop.missed.load(relaxed);
    figures.late_wake_ups = loop.late_wake_ups.value();
    figures.exchange_overruns = loop.exchange_overruns.value();
    figures.catching_up = loop.catching_up.value();
    figures.log_dropped = log_->dropped();
    for (const auto& tap : graph.taps) figures.tap_dropped[tap] = tap->dropped();
    figures.thread = runner_->loop().threadId();
    figures.usage = readThreadUsage(figures.thread);
    return figures;
}

// At once, or when the cycle has ended that is being counted: those after it are not, until then.
void Server::resetStatistics(std::uint64_t connection, std::uint64_t request) {
    constexpr std::int64_t kPeriods = 10;
    const std::int64_t period_ns = runner_->picture().settings.loop.period_ns;
    resets_.push_back({connection, request, monotonicNow() + kSecond + kPeriods * period_ns});
    goOnWithResets();
}

// @return whether it could be taken: not while a cycle is being counted
bool Server::takeBaseline() {
    runner_->holdFigures(true);
    const std::shared_ptr<const GraphSnapshot> graph = runner_->snapshot();
    Figures now;
    if (!runner_->loop().figures().counting.read([&] { now = figures(*graph); })) return false;
    setBaseline(std::move(now));
    return true;
}

void Server::setBaseline(Figures figures) {
    {
        const auto next = std::make_shared<const Figures>(std::move(figures));
        const std::lock_guard<std::mutex> lock(baseline_mutex_);
        baseline_ = next;
    }
    runner_->holdFigures(false);
}

std::shared_ptr<const Server::Figures> Server::baseline() const {
    const std::lock_guard<std::mutex> lock(baseline_mutex_);
    return baseline_;
}

void Server::goOnWithResets() {
    if (resets_.empty()) return;
    v1::Response answer;
    std::vector<Reset> answered;
    if (takeBaseline()) {
        answer.mutable_done();
        answered.swap(resets_);
    } else {
        const std::int64_t now = monotonicNow();
        const auto late =
            std::stable_partition(resets_.begin(), resets_.end(),
                                  [now](const Reset& each) { return now < each.until_ns; });
        if (late == resets_.end()) return;
        answered.assign(late, resets_.end());
        resets_.erase(late, resets_.end());
        if (resets_.empty()) runner_->holdFigures(false);
        const std::string activity = runner_->recorder().realtimeActivity();
        answer = errorResponse(
            0, RefusalKind::Unavailable,
            fmt::format("the loop of {} reaches no cycle boundary: {} does not return; its figures "
                        "go on",
                        runner_->name(), activity.empty() ? "a component" : activity + "()"));
    }
    for (const Reset& each : answered) {
        answer.set_id(each.request);
        respond(each.connection, answer);
    }
}

}  // namespace rtcf::executor
