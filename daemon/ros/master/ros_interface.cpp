#include "ros/master/ros_interface.hpp"

#include <utility>

namespace rtcf::ros1 {

RosInterface::RosInterface(Rosout& rosout, executor::Log& log)
    : rosout_(rosout),
      log_(log),
      publishing_([&log](const std::string& line) { log.write(LogLevel::Warn, {}, line); }),
      reconfiguring_([&log](const std::string& component, const std::string& line) {
          log.write(LogLevel::Warn, component, line + " (requested by dynamic_reconfigure)");
      }) {}

void RosInterface::attach(executor::RunnerView& runner, const executor::AskSupervisor& ask) {
    auto introspection = std::make_unique<Introspection>(runner, ask, log_);
    const std::lock_guard lock(mutex_);
    introspection_ = std::move(introspection);
    rosout_.show(&runner);
}

void RosInterface::detach() {
    const std::lock_guard lock(mutex_);
    introspection_.reset();
}

void RosInterface::configure(const executor::BridgeSettings& settings) {
    publishing_.configure(settings);
    reconfiguring_.refuseOutOfRange(settings.refuse_out_of_range);
}

void RosInterface::setTable(const executor::BridgeTable& table) {
    publishing_.setTaps(table.outputs);
    subscribing_.setInjectors(table.inputs);
    reconfiguring_.setSets(table.parameters);
}

void RosInterface::setClock(std::shared_ptr<executor::SimulatedClock> clock) {
    subscribing_.setClock(std::move(clock));
}

void RosInterface::serveParameters(executor::ParameterRequest request) {
    reconfiguring_.serve(std::move(request));
}

void RosInterface::noteParameterWritten(const std::string& key) { reconfiguring_.noteWritten(key); }

void RosInterface::show(executor::BridgeStatus& status) const {
    status.publications = publishing_.open();
    status.subscriptions = subscribing_.open();
    status.follows_clock = subscribing_.followsClock();
    if (status.problem.empty()) status.problem = publishing_.problem();
    if (status.problem.empty()) status.problem = subscribing_.problem();
    if (status.problem.empty()) status.problem = reconfiguring_.problem();
}

Reconciled RosInterface::reconcile(MasterLink& link, const executor::BridgeSettings& settings) {
    open_ = true;
    if (rejected_ == nullptr) rejected_ = std::make_unique<RejectedConnections>();
    if (link.takeNew()) reconfiguring_.forget();
    ros::NodeHandle& handle = link.node().handle();
    if (introspection_)
        introspection_->open(handle, link.name().full(), claim_.of(link, settings.name_space),
                             settings.peers >= executor::Right::Observe);
    if (!rosout_.isOpen()) rosout_.open(handle, link.name().full());
    // Peers are unauthenticated, so the loop takes their values and their time only if they may
    // operate it.
    const bool operates = settings.peers >= executor::Right::Operate;
    reconfiguring_.allow(settings.peers >= executor::Right::Tune);
    const Reconciled topics =
        publishing_.reconcile(handle) &
        subscribing_.reconcile(handle, operates && link.simulated().value_or(false), operates);
    ParallelCalls master = link.calls();
    return topics & reconfiguring_.reconcile(handle, master, link.caller());
}

void RosInterface::reconcileWithoutMaster(MasterLink& link) {
    subscribing_.reconcileWithoutMaster(link.node().handle());
}

void RosInterface::closeAll(MasterLink& link, MasterLink::Clock::time_point deadline) {
    // At a slow master, withdrawing registrations is more important.
    constexpr auto kReserve = std::chrono::milliseconds(500);
    if (!std::exchange(open_, false)) return;
    link.hide();
    if (introspection_) introspection_->close();
    publishing_.closeAll();
    subscribing_.closeAll();
    ParallelCalls master = link.calls(true);
    reconfiguring_.closeAll(master, link.caller(), deadline - kReserve);
    rosout_.close();
}

}  // namespace rtcf::ros1
