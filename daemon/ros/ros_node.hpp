/// @file
/// The executor's ROS 1 node, by which taps and injectors become topics.
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

/// One per process, and one in its life: roscpp cannot be started again. All
/// work is done in threads of its own; none is real-time. With no master it
/// waits for one; it outlives masters that go and come.
class RosNode final : public executor::Bridge {
   public:
    /// @param daemon names the daemon among those of this host; empty: the system's
    /// @param runner names the node, `/rtcfd/<host>/<runner>` or `/rtcfd/<host>/<daemon>/<runner>`
    /// @param report hears of what changes; not called after the destructor
    /// @param log    what is said by ROS_* macros goes there; its levels are the loggers'; outlives
    /// this
    /// @param rosout opened and closed with the node; outlives this
    /// @param ask who decides on changes that ROS peers ask for by services
    /// @param access whose masters of this machine are followed; outlives this
    RosNode(const std::string& daemon, const std::string& runner, const executor::Access& access,
            executor::BridgeReport report, executor::Log& log, Rosout& rosout,
            executor::AskSupervisor ask);

    /// Withdraws from the master and closes all topics, in less than two seconds whatever the
    /// master does. Taps and injectors are not used any more afterwards.
    ~RosNode() override;
    RosNode(const RosNode&) = delete;
    RosNode& operator=(const RosNode&) = delete;

    bool attach(executor::RunnerView& runner) override;
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
