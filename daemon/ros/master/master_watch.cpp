#include "ros/master/master_watch.hpp"

#include <ros/node_handle.h>
#include <xmlrpcpp/XmlRpcException.h>

#include <cstdlib>

namespace rtcf::ros1 {

namespace {

constexpr auto kPeriod = std::chrono::milliseconds(500);
constexpr auto kCallTimeout = std::chrono::milliseconds(1000);

std::string masterUri(const executor::BridgeSettings& settings) {
    if (!settings.master_uri.empty()) return settings.master_uri;
    const char* environment = std::getenv("ROS_MASTER_URI");
    return environment != nullptr && *environment != '\0' ? environment : "http://localhost:11311";
}

MasterClient clientOf(const std::string& uri, std::chrono::milliseconds timeout,
                      const std::atomic<bool>& cancel) {
    std::string host;
    std::uint32_t port = 0;
    splitMasterUri(uri, host, port);
    return {host, port, timeout, cancel};
}

}  // namespace

MasterWatch::MasterWatch(const std::string& runner, executor::BridgeReport report,
                         executor::Log& log, Rosout& rosout)
    : name_(nodeName(runner)),
      report_(std::move(report)),
      log_(log),
      console_(log),
      rosout_(rosout),
      node_(
          name_,
          [this](const std::string& reason) {
              {
                  const std::lock_guard lock(mutex_);
                  shutdown_request_ = reason;
                  due_ = true;
              }
              changed_.notify_all();
          },
          [this](const std::string& key) {
              reconfiguring_.mirror().noteWritten(key);
              {
                  const std::lock_guard lock(mutex_);
                  due_ = true;
              }
              changed_.notify_all();
          }),
      reconfiguring_([&log](const std::string& component, const std::string& line) {
          log.write(LogLevel::Warn, component, line + " (asked for by dynamic_reconfigure)");
      }) {
    status_.node = name_.full();
}

void MasterWatch::attach(executor::RunnerView& runner, const executor::AskSupervisor& ask) {
    auto introspection = std::make_unique<Introspection>(runner, ask, log_);
    const std::lock_guard lock(mutex_);
    introspection_ = std::move(introspection);
    rosout_.show(&runner);
}

void MasterWatch::configure(const executor::BridgeSettings& settings) {
    reconfiguring_.refuseOutOfRange(settings.refuse_out_of_range);
    {
        const std::lock_guard lock(mutex_);
        if (!settings_ || settings_->master_uri != settings.master_uri)
            status_.simulated_time.reset();
        settings_ = settings;
        status_.enabled = settings.enabled;
        status_.master_uri = masterUri(settings);
        revived_ = true;
        due_ = true;
    }
    changed_.notify_all();
}

void MasterWatch::setTable(const executor::BridgeTable& table) {
    publishing_.setTaps(table.outputs);
    subscribing_.setInjectors(table.inputs);
    reconfiguring_.setSets(table.parameters);
    {
        const std::lock_guard lock(mutex_);
        due_ = true;
    }
    changed_.notify_all();
}

void MasterWatch::setClock(std::shared_ptr<executor::SimulatedClock> clock) {
    subscribing_.setClock(std::move(clock));
    {
        const std::lock_guard lock(mutex_);
        due_ = true;
    }
    changed_.notify_all();
}

executor::BridgeStatus MasterWatch::status() const {
    executor::BridgeStatus status;
    {
        const std::lock_guard lock(mutex_);
        status = status_;
    }
    status.publications = publishing_.open();
    status.subscriptions = subscribing_.open();
    status.follows_clock = subscribing_.followsClock();
    if (status.problem.empty()) status.problem = publishing_.problem();
    if (status.problem.empty()) status.problem = subscribing_.problem();
    if (status.problem.empty()) status.problem = reconfiguring_.problem();
    return status;
}

void MasterWatch::serveParameters(executor::ParameterRequest request) {
    reconfiguring_.serve(std::move(request));
}

void MasterWatch::stop() {
    stop_ = true;
    reconfiguring_.end();
    node_.leaveMaster();
    {
        const std::lock_guard lock(mutex_);
        due_ = true;
    }
    changed_.notify_all();
}

void MasterWatch::awaitNode() {
    constexpr auto kPatience = std::chrono::seconds(5);  // a step may wait for several calls
    std::unique_lock lock(mutex_);
    due_ = true;
    changed_.notify_all();
    // What a step that has begun already found may be old.
    const std::uint64_t wanted = steps_begun_ + 1;
    const auto known = [&] {
        return stop_ || (settings_ && !settings_->enabled) || steps_ended_ >= wanted;
    };
    const bool in_time = changed_.wait_for(lock, kPatience, known);
    if (settings_ && !settings_->enabled) {
        throw NoMaster("ROS is off for this runner: turn it on: rtcfctl runner set " + name_.base +
                       " --ros");
    }
    if (in_time && status_.connected) return;
    const std::string silent = "no ROS master answers at " + status_.master_uri;
    const bool other = in_time && !status_.problem.empty() && status_.problem.rfind(silent, 0) != 0;
    throw NoMaster(other ? status_.problem : silent + ": start one (roscore), or load with --wait");
}

void MasterWatch::run() {
    while (true) {
        {
            std::unique_lock lock(mutex_);
            changed_.wait_for(lock, kPeriod, [this] { return due_; });
            due_ = false;
            if (stop_) break;
            if (!settings_) continue;
            ++steps_begun_;
        }
        // What a master answers must never end the executor.
        try {
            step();
        } catch (const std::exception& error) {
            setProblem(std::string("ROS: ") + error.what());
        } catch (const XmlRpc::XmlRpcException& error) {  // not a std::exception
            setProblem("the ROS master's answer is not understood: " + error.getMessage());
        }
        {
            const std::lock_guard lock(mutex_);
            steps_ended_ = steps_begun_;
        }
        changed_.notify_all();
    }
    end();
    changed_.notify_all();
}

void MasterWatch::step() {
    executor::BridgeSettings settings;
    {
        const std::lock_guard lock(mutex_);
        settings = *settings_;
        if (std::exchange(revived_, false) && off_ == Off::Killed) off_ = Off::No;
    }
    if (failed_) return;
    const std::string uri = masterUri(settings);
    std::string host;
    std::uint32_t port = 0;
    if (settings.enabled && !splitMasterUri(uri, host, port)) {
        return setProblem("the ROS master's URI '" + uri +
                          "' is none; it has the form http://HOST:PORT");
    }
    if (settings.enabled) publishing_.prepare(settings);
    if (!node_.started()) {
        if (!settings.enabled) return setProblem("");
        if (!startNode(uri, settings.hostname)) return;
    }
    if (!node_.alive()) {
        failed_ = true;
        return setProblem(
            "something in this process has shut down ROS: restart the executor to have it again");
    }
    if (!settings.enabled) {
        MasterClient master = clientOf(master_uri_, kCallTimeout, stop_);
        if (leaveTopics(master)) say("ROS node " + name_.full() + " is off");
        return setProblem("");
    }
    if (uri != master_uri_) changeMaster(uri);
    if (settings.hostname != hostname_) {
        hostname_ = settings.hostname;
        say("the new ROS hostname takes effect at the next start of the executor");
    }
    MasterClient master = clientOf(uri, kCallTimeout, stop_);
    obeyShutdownRequest(master);
    if (!watchMaster(master)) {
        if (off_ == Off::No) subscribing_.reconcileWithoutMaster(node_.handle());
        return;
    }
    {
        // Starting a node takes its time: topics are opened as is wanted by now.
        const std::lock_guard lock(mutex_);
        settings = *settings_;
    }
    askForSimulation(master);
    openAndClose(master, settings);
}

// Nothing if it does not answer.
std::optional<int> MasterWatch::pidOf(MasterClient& master) const {
    XmlRpc::XmlRpcValue arguments;
    arguments[0] = name_.full();
    MasterAnswer answer = master.call("getPid", arguments);
    if (answer.silent()) return std::nullopt;
    const bool is_number = answer.value.getType() == XmlRpc::XmlRpcValue::TypeInt;
    return is_number ? static_cast<int&>(answer.value) : 0;
}

bool MasterWatch::startNode(const std::string& uri, const std::string& hostname) {
    MasterClient master = clientOf(uri, kCallTimeout, stop_);
    master_pid_ = pidOf(master);
    if (!master_pid_) {
        setProblem("no ROS master answers at " + uri);
        say("no ROS master answers at " + uri + ": waiting for one");
        return false;
    }
    try {
        node_.start(uri, hostname);
    } catch (const std::exception& error) {
        failed_ = true;
        const std::string problem =
            std::string("the ROS node could not be started: ") + error.what();
        setProblem(problem);
        say(problem);
        return false;
    }
    refusals_ = std::make_unique<Refusals>();
    master_uri_ = uri;
    hostname_ = hostname;
    registered_ = true;  // roscpp has done so
    say("ROS node " + name_.full() + " is up at " + uri);
    return true;
}

void MasterWatch::changeMaster(const std::string& uri) {
    MasterClient old = clientOf(master_uri_, kCallTimeout, stop_);
    MasterClient node = self();
    withdrawAll(old, node, node_, std::chrono::steady_clock::now() + std::chrono::seconds(1));
    node_.useMaster(uri);
    master_uri_ = uri;
    registered_ = false;
    was_silent_ = false;
    if (off_ == Off::NameTaken) off_ = Off::No;
}

// The node itself stays, so that it can come back; roscpp cannot be started twice.
void MasterWatch::obeyShutdownRequest(MasterClient& master) {
    std::optional<std::string> reason;
    {
        const std::lock_guard lock(mutex_);
        reason.swap(shutdown_request_);
    }
    if (reason) {
        off_ = reason->find("same name") != std::string::npos ? Off::NameTaken : Off::Killed;
    }
    if (off_ == Off::No) return;
    leaveTopics(master);
    say(whyOff());
    setProblem(whyOff());
}

std::string MasterWatch::whyOff() const {
    if (off_ == Off::Killed) {
        return "ROS node " + name_.full() +
               " was asked to shut down: it is off until ROS is configured again";
    }
    return "another node named " + name_.full() +
           " runs at this ROS master: give its host or runner another name";
}

// Closes all topics and withdraws what is left. roscpp asks the master while it
// closes, so that one must answer. @return true if there was anything, and it is done
bool MasterWatch::leaveTopics(MasterClient& master) {
    const bool shown = introspection_ && introspection_->isOpen();
    if (!registered_ && !shown && publishing_.open() == 0 && subscribing_.open() == 0) return false;
    if (lookUp(master, node_).kind == Lookup::Kind::Silent) return false;
    if (introspection_) introspection_->close();
    publishing_.closeAll();
    subscribing_.closeAll();
    reconfiguring_.mirror().leaveAll(master, caller());
    reconfiguring_.closeAll();
    rosout_.close();
    MasterClient node = self();
    withdrawAll(master, node, node_, std::chrono::steady_clock::now() + kCallTimeout);
    registered_ = false;
    return true;
}

// True if another node has our name and we are not to fight for it: until the
// master has told us to go, or, afterwards, until that node does not answer.
bool MasterWatch::nameIsTaken(const Lookup& found) {
    constexpr int kPatience = 3;  // steps
    if (found.kind != Lookup::Kind::Other) {
        taken_ = 0;
        off_ = Off::No;
        return false;
    }
    XmlRpc::XmlRpcValue arguments;
    arguments[0] = name_.full();
    const bool answers =
        !clientOf(found.uri, kCallTimeout, stop_).call("getPid", arguments).silent();
    taken_ = off_ == Off::NameTaken && answers ? 0 : taken_ + 1;
    if (taken_ < kPatience) return true;
    taken_ = 0;
    off_ = Off::No;
    return false;
}

// @return true if the master answers, knows of the node, and topics can be opened
bool MasterWatch::watchMaster(MasterClient& master) {
    if (off_ == Off::Killed) return false;
    const Lookup found = lookUp(master, node_);
    if (found.kind == Lookup::Kind::Silent) {
        setProblem("no ROS master answers at " + master_uri_ + "; open connections go on");
        say("the ROS master at " + master_uri_ +
            " does not answer any more: open connections go on");
        was_silent_ = true;
        return false;
    }
    if (nameIsTaken(found)) return false;
    const bool returned = std::exchange(was_silent_, false);
    // A hook may have registered something at a new master before we have looked.
    const std::optional<int> pid = pidOf(master);
    const bool is_new = pid && master_pid_ != pid;
    const bool known = found.kind == Lookup::Kind::Ours && registered_ && !is_new;
    if (known && !returned) return true;
    // One that was out of reach has told us nothing of publishers that came or went meanwhile.
    MasterClient node = self();
    if (!known) reconfiguring_.mirror().forget();
    registered_ = registerAll(master, node, node_);
    if (!registered_) {
        setProblem("the ROS master at " + master_uri_ + " did not take all registrations");
        return false;
    }
    master_pid_ = pid;
    say(known ? "the ROS master at " + master_uri_ + " answers again"
              : "ROS node " + name_.full() + " is registered again at " + master_uri_);
    return true;
}

void MasterWatch::openAndClose(MasterClient& master, const executor::BridgeSettings& settings) {
    if (introspection_)
        introspection_->open(node_.handle(),
                             settings.name_space.empty() ? "/" + name_.base : settings.name_space);
    if (!rosout_.isOpen()) rosout_.open(node_.handle(), name_.full());
    publishing_.reconcile(node_.handle(), settings);
    subscribing_.reconcile(node_.handle(), simulated_);
    if (!reconfiguring_.reconcile(node_.handle(), master, caller())) {
        const std::lock_guard lock(mutex_);
        due_ = true;  // the rest at the next step, without waiting for it
    }
    // If it has gone meanwhile, do it again later.
    if (node_.calls().takeMissed()) registered_ = false;
    setConnected();
    for (const std::string& refusal : refusals_->take()) say(refusal);
}

ParameterMirror::Caller MasterWatch::caller() const { return {name_.full(), node_.uri()}; }

MasterClient MasterWatch::self() const { return {"127.0.0.1", node_.port(), kCallTimeout, stop_}; }

void MasterWatch::end() {
    if (node_.started() && node_.alive()) {
        const std::atomic<bool> never{false};
        constexpr auto kShort = std::chrono::milliseconds(300);
        MasterClient master = clientOf(master_uri_, kShort, never);
        MasterClient node("127.0.0.1", node_.port(), kShort, never);
        reconfiguring_.mirror().leaveAll(master, caller());
        withdrawAll(master, node, node_, std::chrono::steady_clock::now() + 2 * kShort);
        node_.leaveMaster();
    }
    if (introspection_) introspection_->close();
    introspection_.reset();
    publishing_.setTaps({});
    publishing_.closeAll();
    subscribing_.closeAll();
    reconfiguring_.closeAll();
    rosout_.close();
    refusals_.reset();
    node_.stop();
}

void MasterWatch::setProblem(const std::string& problem) {
    const std::lock_guard lock(mutex_);
    status_.connected = false;
    status_.problem = problem;
    status_.simulated_time.reset();
}

void MasterWatch::setConnected() {
    const std::lock_guard lock(mutex_);
    status_.connected = true;
    status_.problem = refusals_->recent();
}

// As it may be set at any time before a loop starts, it is asked for again and again.
void MasterWatch::askForSimulation(MasterClient& master) {
    XmlRpc::XmlRpcValue arguments;
    arguments[0] = name_.full();
    arguments[1] = "/use_sim_time";
    MasterAnswer answer = master.call("getParam", arguments);
    if (answer.silent()) return;
    simulated_ = answer && answer.value.getType() == XmlRpc::XmlRpcValue::TypeBoolean &&
                 static_cast<bool&>(answer.value);
    const std::lock_guard lock(mutex_);
    status_.simulated_time = simulated_;
}

void MasterWatch::say(const std::string& message) {
    if (message == said_) return;
    said_ = message;
    report_(message);
}

}  // namespace rtcf::ros1
