#include "ros/ros_node.hpp"

#include "ros/master/master_watch.hpp"
#include "ros/threads/quiet_thread.hpp"

namespace rtcf::ros1 {

RosNode::RosNode(const std::string& daemon, const std::string& runner,
                 const executor::Access& access, executor::BridgeReport report, executor::Log& log,
                 Rosout& rosout, executor::AskSupervisor ask)
    : ask_(std::move(ask)),
      watch_(std::make_unique<MasterWatch>(nodeName(daemon, runner), access, std::move(report), log,
                                           rosout)),
      thread_(quietThread("ros-watch", [this] { watch_->run(); })) {}

RosNode::~RosNode() {
    watch_->stop();
    thread_.join();
}

void RosNode::attach(executor::RunnerView& runner) { watch_->attach(runner, ask_); }

void RosNode::configure(const executor::BridgeSettings& settings) { watch_->configure(settings); }

void RosNode::setTable(std::shared_ptr<const executor::BridgeTable> table) {
    watch_->setTable(table ? *table : executor::BridgeTable{});
}

void RosNode::setClock(std::shared_ptr<executor::SimulatedClock> clock) {
    watch_->setClock(std::move(clock));
}

executor::BridgeStatus RosNode::status() const { return watch_->status(); }

bool RosNode::feeds(const executor::Injector& injector) const { return watch_->feeds(injector); }

void RosNode::serveParameters(executor::ParameterRequest request) {
    watch_->serveParameters(std::move(request));
}

executor::HookGate* RosNode::hooks() noexcept { return &watch_->hooks(); }

}  // namespace rtcf::ros1
