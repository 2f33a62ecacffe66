#include "ros/master/master_watch.hpp"

#include <xmlrpcpp/XmlRpcException.h>

#include <utility>

namespace rtcf::ros1 {

namespace {

constexpr auto kPeriod = std::chrono::milliseconds(500);
constexpr auto kFresh = std::chrono::milliseconds(1000);    // longest age of a master's answer
constexpr auto kLeaving = std::chrono::milliseconds(1500);  // for all calls while leaving a master

}  // namespace

MasterWatch::MasterWatch(NodeName name, const executor::Access& access,
                         executor::BridgeReport report, executor::Log& log, Rosout& rosout)
    : runner_(name.base),
      report_(std::move(report)),
      console_(log),
      link_(
          std::move(name), access, [this](const std::string& message) { say(message); },
          [this] { wake(); },
          [this](const std::string& key) {
              interface_.noteParameterWritten(key);
              wake();
          }),
      interface_(rosout, log) {
    status_.node = link_.name().full();
}

void MasterWatch::attach(executor::RunnerView& runner, const executor::AskSupervisor& ask) {
    interface_.attach(runner, ask);
}

void MasterWatch::configure(const executor::BridgeSettings& settings) {
    interface_.configure(settings);
    {
        const std::lock_guard lock(mutex_);
        if (!settings_ || settings_->master_uri != settings.master_uri)
            status_.simulated_time.reset();
        settings_ = settings;
        status_.enabled = settings.enabled;
        status_.master_uri = MasterLink::uriOf(settings);
    }
    link_.revive();
    wake();
}

void MasterWatch::setTable(const executor::BridgeTable& table) {
    interface_.setTable(table);
    wake();
}

void MasterWatch::setClock(std::shared_ptr<executor::SimulatedClock> clock) {
    interface_.setClock(std::move(clock));
    wake();
}

executor::BridgeStatus MasterWatch::status() const {
    executor::BridgeStatus status;
    {
        const std::lock_guard lock(mutex_);
        status = status_;
    }
    interface_.show(status);
    return status;
}

void MasterWatch::serveParameters(executor::ParameterRequest request) {
    interface_.serveParameters(std::move(request));
}

void MasterWatch::stop() {
    stop_ = true;
    interface_.end();
    link_.hurry();
    wake();
}

void MasterWatch::wake() {
    {
        const std::lock_guard lock(mutex_);
        due_ = true;
    }
    changed_.notify_all();
}

void MasterWatch::awaitNode() {
    constexpr auto kPatience = std::chrono::seconds(5);  // a step may make several calls
    std::unique_lock lock(mutex_);
    const auto off = [&] { return settings_ && !settings_->enabled; };
    // If the master has gone since, the hook's own calls fail.
    const auto there = [&] {
        return status_.connected && MasterLink::Clock::now() < answered_ + kFresh;
    };
    if (!off() && there()) return;
    due_ = true;
    changed_.notify_all();
    // The result of a running step may be old, so wait for the next one.
    const std::uint64_t wanted = steps_begun_ + 1;
    const auto known = [&] { return stop_ || off() || there() || steps_ended_ >= wanted; };
    const bool in_time = changed_.wait_for(lock, kPatience, known);
    if (off()) {
        throw NoMaster("ROS is off for this runner: turn it on: rtcfctl runner set " + runner_ +
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
        // An answer of a master must never end the executor.
        try {
            step();
        } catch (const std::exception& error) {
            setProblem(std::string("ROS: ") + error.what());
        } catch (const XmlRpc::XmlRpcException& error) {  // not a std::exception
            setProblem("cannot parse the ROS master's answer: " + error.getMessage());
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
    }
    interface_.tidy();
    if (!settings.enabled) {
        if (link_.up()) say("ROS node " + link_.name().full() + " is off");
        leave();
        link_.retry();
        setProblem("");
        return;
    }
    const MasterLink::State state = link_.look(settings);
    {
        const std::lock_guard lock(mutex_);
        status_.node = link_.name().full();
    }
    if (state == MasterLink::State::Up) {
        serve(settings);
        return;
    }
    if (state == MasterLink::State::Off) leave();
    if (state == MasterLink::State::Silent) interface_.reconcileWithoutMaster(link_);
    setProblem(link_.problem());
}

void MasterWatch::serve(const executor::BridgeSettings& looked) {
    executor::BridgeSettings settings;
    {
        // Starting a node takes time, so use the newest settings.
        const std::lock_guard lock(mutex_);
        settings = *settings_;
        if (settings.enabled != looked.enabled) return;
        answered_ = MasterLink::Clock::now();
        const bool operates = settings.peers >= executor::Right::Operate;
        status_.simulated_time = operates ? link_.simulated() : std::optional<bool>(false);
    }
    const Reconciled result = interface_.reconcile(link_, settings);
    link_.awaitRegistrations();
    const std::string unreachable = link_.unreachable();
    if (unreachable != unreachable_) {
        unreachable_ = unreachable;
        if (!unreachable.empty()) say(unreachable);
    }
    setConnected();
    if (result == Reconciled::Again) wake();
    for (const std::string& rejection : interface_.newRejections()) say(rejection);
}

// Closes all topics and withdraws all registrations. The node stays, because roscpp cannot be
// started twice.
void MasterWatch::leave() {
    if (!link_.up()) return;
    const auto deadline = MasterLink::Clock::now() + kLeaving;
    interface_.closeAll(link_, deadline);
    sayLeft(link_.leave(deadline));
}

void MasterWatch::end() {
    const auto deadline = MasterLink::Clock::now() + kLeaving;
    interface_.drop();
    interface_.closeAll(link_, deadline);
    sayLeft(link_.end(deadline));
    interface_.detach();
}

void MasterWatch::setProblem(const std::string& problem) {
    const std::lock_guard lock(mutex_);
    status_.connected = false;
    status_.problem = problem;
    status_.killed = link_.killed();
    status_.simulated_time.reset();
}

void MasterWatch::setConnected() {
    const std::lock_guard lock(mutex_);
    status_.connected = true;
    status_.killed = false;
    status_.problem = unreachable_.empty() ? interface_.notice() : unreachable_;
}

void MasterWatch::say(const std::string& message) {
    if (message == said_) return;
    said_ = message;
    report_(message);
}

void MasterWatch::sayLeft(std::size_t left) {
    if (left == 0) return;
    say(std::to_string(left) + " registrations of ROS node " + link_.name().full() +
        " may be left at the ROS master, which did not answer in time; `rosnode cleanup` removes "
        "them");
}

}  // namespace rtcf::ros1
