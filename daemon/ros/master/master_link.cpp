#include "ros/master/master_link.hpp"

#include <cstdlib>
#include <utility>

#include "ros/master/listener.hpp"

namespace rtcf::ros1 {

namespace {

constexpr auto kCallTimeout = std::chrono::milliseconds(1000);
constexpr auto kResolving = std::chrono::milliseconds(500);

bool isLoopback(const std::string& address) {
    return address.rfind("127.", 0) == 0 || address == "::1";
}

}  // namespace

// The answers of a master to check().
struct MasterLink::CheckResult {
    bool silent = true;
    std::string node_uri;  // URI of the node with our name; empty = none
    std::optional<int> pid;
    std::optional<bool> simulated;
};

MasterLink::MasterLink(NodeName name, const executor::Access& access, Say say,
                       const std::function<void()>& wake,
                       const RoscppNode::ParameterWritten& written)
    : access_(access),
      say_(std::move(say)),
      own_name_(name),
      node_(
          std::move(name),
          [this, wake](const std::string& /*reason*/) {
              {
                  const std::lock_guard lock(mutex_);
                  shutdown_request_ = true;
              }
              wake();
          },
          written) {}

std::string MasterLink::uriOf(const executor::BridgeSettings& settings) {
    if (!settings.master_uri.empty()) return settings.master_uri;
    const char* environment = std::getenv("ROS_MASTER_URI");
    return environment != nullptr && *environment != '\0' ? environment : "http://localhost:11311";
}

MasterLink::State MasterLink::look(const executor::BridgeSettings& settings) {
    if (failed_) return State::Failed;
    if (!node_.started()) node_.rename(nodeNameOf(settings.name_space, own_name_));
    const std::string uri = uriOf(settings);
    MasterAddress address;
    if (!locate(uri, address)) return State::Away;
    if (!mayFollow(uri, address, settings.peers)) return node_.started() ? State::Off : State::Away;
    if (!node_.started() && !start(uri, address, settings))
        return failed_ ? State::Failed : State::Away;
    if (!node_.alive()) {
        failed_ = true;
        problem_ =
            "something in this process has shut down ROS: restart the executor to use ROS again";
        return State::Failed;
    }
    if (uri != uri_) {
        moveTo(uri, address);
    } else if (address.address != address_.address) {
        useAddress(address);
        node_.calls().moveTo(address);
    }
    if (settings.hostname != hostname_) {
        hostname_ = settings.hostname;
        say_("the new ROS hostname takes effect at the next start of the executor");
    }
    // Read before the check, so that the master's answers are newer.
    const bool was_registered = node_.registrar().hasRegistered();
    const bool asked_to_go = takeShutdownRequest();
    const CheckResult found = check();
    if (asked_to_go) obeyShutdownRequest(found);
    if (found.silent) {
        hosts_.doubt(host_);
        was_silent_ = true;
        if (off_ != Why::No) return State::Off;
        problem_ = "no ROS master answers at " + uri_ + "; open connections continue";
        say_("the ROS master at " + uri_ + " no longer answers: open connections continue");
        return State::Silent;
    }
    const bool is_new = found.pid && master_pid_ && *master_pid_ != *found.pid;
    if (is_new && off_ == Why::Killed) off_ = Why::No;
    if (off_ == Why::Killed || nameIsTaken(found)) {
        problem_ = whyOff();
        return State::Off;
    }
    simulated_ = found.simulated;
    const bool returned = std::exchange(was_silent_, false);
    // A hook may have registered something at a new master before this check.
    const bool lost = is_new || (was_registered && found.node_uri != node_.uri());
    if (lost) new_ = true;
    // A master that was out of reach has not reported new or lost publishers meanwhile.
    if (lost || returned) node_.registrar().forget();
    master_pid_ = found.pid;
    node_.registrar().show(true);
    node_.registrar().retry();
    if (lost || returned) {
        if (!node_.registrar().flush(Clock::now() + kCallTimeout))
            return away("the ROS master at " + uri_ + " did not accept all registrations");
        say_(lost ? "ROS node " + name().full() + " is registered again at " + uri_
                  : "the ROS master at " + uri_ + " answers again");
    }
    problem_.clear();
    up_ = true;
    return State::Up;
}

void MasterLink::revive() {
    const std::lock_guard lock(mutex_);
    revived_ = true;
}

std::size_t MasterLink::leave(Clock::time_point deadline) {
    up_ = false;
    if (!node_.started()) return 0;
    return node_.registrar().withdraw(deadline);
}

std::size_t MasterLink::end(Clock::time_point deadline) {
    const std::size_t left = node_.started() && node_.alive() ? leave(deadline) : 0;
    node_.stop();
    return left;
}

std::string MasterLink::unreachable() {
    std::string host;
    std::uint32_t port = 0;
    if (!splitMasterUri(node_.uri(), host, port)) return {};
    std::string reason;
    const std::optional<std::string> address = hosts_.address(host, kResolving);
    if (!address) {
        reason = "which has no address";
    } else if (!isOfThisMachine(*address)) {
        reason = "which is not an address of this machine";
    } else if (isLoopback(*address) && !isOfThisMachine(address_.address)) {
        reason = "which is " + *address + ", to a ROS master on another machine";
    } else {
        return {};
    }
    return "ROS peers cannot connect: node " + name().full() + " advertises " + host + ", " +
           reason + ": correct ROS_IP or ROS_HOSTNAME, and restart the runner";
}

void MasterLink::awaitRegistrations() {
    constexpr auto kPatience = std::chrono::milliseconds(500);
    node_.registrar().flush(Clock::now() + kPatience);
}

void MasterLink::hurry() noexcept {
    hurry_ = true;
    node_.leaveMaster();
}

MasterLink::State MasterLink::away(const std::string& problem) {
    problem_ = problem;
    return State::Away;
}

bool MasterLink::locate(const std::string& uri, MasterAddress& address) {
    std::string host;
    if (!splitMasterUri(uri, host, address.port)) {
        away("the ROS master's URI '" + uri + "' is invalid; use the form http://HOST:PORT");
        return false;
    }
    host_ = host;
    const std::optional<std::string> found = hosts_.address(host, kResolving);
    if (!found) {
        away("no ROS master answers at " + uri + ": the name '" + host + "' has no address yet");
        say_(problem_);
        return false;
    }
    address.address = *found;
    return true;
}

// Any user can start a master at the expected address, and act as all of its nodes. So the owner of
// the master must have the right that ROS peers have.
bool MasterLink::mayFollow(const std::string& uri, const MasterAddress& address,
                           executor::Right needed) {
    const std::optional<uid_t> owner = ownerOfListener(address);
    if (!owner) return true;  // on another machine, or no master
    const executor::Right right = access_.ofUser(*owner);
    if (right >= needed) return true;
    away("the ROS master at " + uri + " belongs to user " + std::to_string(*owner) +
         " of this machine, who has the right '" + executor::wordOf(right) +
         "': the runner does not use it, because its ROS peers have the right '" +
         executor::wordOf(needed) +
         "'; give that user this right in [access], or reduce that of peers: rtcfctl runner set "
         "--ros-peers");
    say_(problem_);
    return false;
}

bool MasterLink::start(const std::string& uri, const MasterAddress& address,
                       const executor::BridgeSettings& settings) {
    ParallelCalls master(address, hurry_);
    if (!chooseName(master)) {
        away("no ROS master answers at " + uri);
        say_(problem_ + ": waiting for one");
        return false;
    }
    try {
        node_.start(uri, address, settings.hostname);
    } catch (const std::exception& error) {
        failed_ = true;
        problem_ = std::string("cannot start the ROS node: ") + error.what();
        say_(problem_);
        return false;
    }
    uri_ = uri;
    useAddress(address);
    hostname_ = settings.hostname;
    new_ = true;
    say_("ROS node " + name().full() + " is up at " + uri);
    return true;
}

// Chooses the first name that no other node has: the configured one, the runner's own, or the
// runner's own with a number. A master ends the first of two nodes with the same name.
// @return false if the master does not answer
bool MasterLink::chooseName(ParallelCalls& master) {
    constexpr int kMost = 9;
    const NodeName wanted = node_.name();
    std::vector<NodeName> names{wanted};
    if (own_name_.full() != wanted.full()) names.push_back(own_name_);
    for (int i = 2; i <= kMost; ++i) {
        NodeName name = own_name_;
        name.base += "_" + std::to_string(i);
        names.push_back(std::move(name));
    }
    std::vector<MasterCall> calls;
    for (const NodeName& name : names)
        calls.push_back({"lookupNode", texts({name.full(), name.full()})});
    std::vector<MasterAnswer> found = master.run(calls, kCallTimeout, Clock::now() + kCallTimeout);
    for (std::size_t i = 0; i < found.size(); ++i) {
        if (found[i].silent()) return false;
        const bool taken = found[i] && mayLive(found[i].text());
        if (taken && i + 1 < found.size()) continue;
        if (i != 0) {
            say_("another node named " + wanted.full() + " runs at this ROS master: this one is " +
                 names[i].full());
        }
        node_.rename(std::move(names[i]));
        return true;
    }
    return false;
}

void MasterLink::moveTo(const std::string& uri, const MasterAddress& address) {
    node_.registrar().withdraw(Clock::now() + kCallTimeout);
    node_.useMaster(uri, address);
    uri_ = uri;
    useAddress(address);
    was_silent_ = false;
    new_ = true;
    master_pid_.reset();
    off_ = Why::No;
}

void MasterLink::useAddress(const MasterAddress& address) {
    address_ = address;
    looks_ = std::make_unique<ParallelCalls>(address, hurry_);
}

MasterLink::CheckResult MasterLink::check() {
    const std::string caller = node_.name().full();
    const std::vector<MasterCall> calls{{"lookupNode", texts({caller, caller})},
                                        {"getPid", texts({caller})},
                                        {"getParam", texts({caller, "/use_sim_time"})}};
    std::vector<MasterAnswer> answers =
        looks_->run(calls, kCallTimeout, Clock::now() + kCallTimeout);
    CheckResult result;
    MasterAnswer& node = answers[0];
    MasterAnswer& pid = answers[1];
    MasterAnswer& time = answers[2];
    result.silent = node.silent() || pid.silent();
    if (node) result.node_uri = node.text();
    if (pid && pid.value.getType() == XmlRpc::XmlRpcValue::TypeInt)
        result.pid = static_cast<int&>(pid.value);
    // Queried again each time, because it may be set at any time before a loop starts.
    if (!time.silent()) {
        result.simulated = time && time.value.getType() == XmlRpc::XmlRpcValue::TypeBoolean &&
                           static_cast<bool&>(time.value);
    }
    return result;
}

bool MasterLink::lives(const std::string& node) {
    std::vector<MasterAnswer> found = calls().run({{"lookupNode", texts({name().full(), node})}},
                                                  kCallTimeout, Clock::now() + kCallTimeout);
    return found[0] && mayLive(found[0].text());
}

// A node on this machine that does not answer is dead, and so is a node without a valid URI.
bool MasterLink::mayLive(const std::string& node_uri) {
    std::string host;
    std::uint32_t port = 0;
    if (!splitMasterUri(node_uri, host, port)) return false;
    bool here = false;
    return answers(node_uri, here) || !here;
}

// @param here set to true if the node is on this machine
bool MasterLink::answers(const std::string& node_uri, bool& here) {
    std::string host;
    MasterAddress address;
    if (!splitMasterUri(node_uri, host, address.port)) return false;
    const std::optional<std::string> found = hosts_.address(host, kResolving);
    if (!found) return true;  // the node cannot be reached, but may be alive
    address.address = *found;
    here = isOfThisMachine(address.address);
    MasterClient node(address, kCallTimeout, hurry_);
    return !node.call("getPid", texts({name().full()})).silent();
}

bool MasterLink::takeShutdownRequest() {
    const std::lock_guard lock(mutex_);
    if (std::exchange(revived_, false) && off_ == Why::Killed) off_ = Why::No;
    return std::exchange(shutdown_request_, false);
}

// Switches the node off. The roscpp node itself stays, because roscpp cannot be started twice. The
// master requests a shutdown when another node takes the name; others do by `rosnode kill`.
void MasterLink::obeyShutdownRequest(const CheckResult& found) {
    if (found.silent) {  // the reason is found at the next check
        const std::lock_guard lock(mutex_);
        shutdown_request_ = true;
        return;
    }
    const bool taken = !found.node_uri.empty() && found.node_uri != node_.uri();
    off_ = taken ? Why::NameTaken : Why::Killed;
    say_(whyOff());
}

std::string MasterLink::whyOff() const {
    if (off_ == Why::Killed) {
        return "ROS node " + name().full() +
               " received a shutdown request: it is off until there is a new master, or `rtcfctl "
               "runner set --ros`";
    }
    return "another node named " + name().full() +
           " runs at this ROS master: rename its host or runner";
}

// True while another node has our name and may keep it. After the master's shutdown request, that
// node keeps the name while it answers. Otherwise, this node takes it back at the third check in a
// row.
bool MasterLink::nameIsTaken(const CheckResult& found) {
    constexpr int kPatience = 3;  // checks
    if (found.node_uri.empty() || found.node_uri == node_.uri()) {
        taken_ = 0;
        off_ = Why::No;
        return false;
    }
    bool here = false;
    const bool alive = answers(found.node_uri, here);
    taken_ = off_ == Why::NameTaken && alive ? 0 : taken_ + 1;
    if (taken_ < kPatience) return true;
    taken_ = 0;
    off_ = Why::No;
    return false;
}

}  // namespace rtcf::ros1
