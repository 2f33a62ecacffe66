/// @file
/// The executor's ROS 1 node, which connects taps and injectors to topics.
#pragma once

#include <memory>
#include <string>
#include <thread>

#include "access/rights.hpp"
#include "bridge/bridge.hpp"
#include "bridge/outside_call.hpp"
#include "logging/log.hpp"

namespace rtcf::ros1 {

class MasterWatch;
class Rosout;

/// One per process, and only once: roscpp cannot be started again. It works in its own threads,
/// none of them real-time. Without a master, it waits for one; it survives restarts of the master.
class RosNode final : public executor::Bridge {
   public:
    /// @param daemon name of the daemon on this host; empty = the system daemon
    /// @param runner name of the runner; the node is `/rtcfd/<host>/<runner>` or
    /// `/rtcfd/<host>/<daemon>/<runner>`
    /// @param access rights of users, which decide on masters of this machine; outlives this object
    /// @param report called on changes; not called after the destructor
    /// @param log    receives messages of ROS_* macros; its levels are those of ROS loggers;
    /// outlives this object
    /// @param rosout opened and closed with the node; outlives this object
    /// @param ask    requests changes from rtcfd for ROS peers
    RosNode(const std::string& daemon, const std::string& runner, const executor::Access& access,
            executor::BridgeReport report, executor::Log& log, Rosout& rosout,
            executor::AskSupervisor ask);

    /// Withdraws all registrations and closes all topics, in less than two seconds even if the
    /// master hangs. Does not use taps and injectors afterwards.
    ~RosNode() override;
    RosNode(const RosNode&) = delete;
    RosNode& operator=(const RosNode&) = delete;

    void attach(executor::RunnerView& runner) override;
    void configure(const executor::BridgeSettings& settings) override;
    void setTable(std::shared_ptr<const executor::BridgeTable> table) override;
    void setClock(std::shared_ptr<executor::SimulatedClock> clock) override;
    executor::BridgeStatus status() const override;
    bool feeds(const executor::Injector& injector) const override;
    executor::HookGate* hooks() noexcept override;
    void serveParameters(executor::ParameterRequest request) override;

   private:
    const executor::AskSupervisor ask_;
    std::unique_ptr<MasterWatch> watch_;
    std::thread thread_;
};

}  // namespace rtcf::ros1
