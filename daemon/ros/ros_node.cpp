#include "ros/ros_node.hpp"

#include <unistd.h>

#include <cstdio>
#include <cstdlib>

#include "ros/master_watch.hpp"
#include "ros/quiet_thread.hpp"

namespace rtcf::ros1 {

RosNode::RosNode(std::string runner, executor::BridgeReport report)
    : watch_(std::make_shared<MasterWatch>(runner, std::move(report))),
      thread_(quietThread("ros-watch", [watch = watch_] { watch->run(); })) {}

RosNode::~RosNode() {
    watch_->stop();
    if (watch_->waitForEnd(std::chrono::milliseconds(1800))) {
        thread_.join();
    } else {
        // A master that went silent in the middle of one of roscpp's own calls,
        // which have no bound. The thread keeps what it uses alive. roscpp's exit
        // handler would wait for that master too; this one runs before it.
        thread_.detach();
        on_exit(
            [](int status, void* /*unused*/) {
                std::fflush(nullptr);
                _exit(status);
            },
            nullptr);
    }
}

void RosNode::configure(const executor::BridgeSettings& settings) { watch_->configure(settings); }

void RosNode::setTable(std::shared_ptr<const executor::BridgeTable> table) {
    watch_->setTable(table ? *table : executor::BridgeTable{});
}

executor::BridgeStatus RosNode::status() const { return watch_->status(); }

}  // namespace rtcf::ros1
