/// @file
/// The life of the node: waits for a master, opens and closes the runner's topics and services,
/// grants hooks access to the node, and shuts everything down in order. Owned by the ROS node;
/// run() has its own thread, the watch thread.
#pragma once

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "bridge/bridge.hpp"
#include "ros/logging/console_backend.hpp"
#include "ros/logging/rosout.hpp"
#include "ros/master/master_link.hpp"
#include "ros/master/ros_interface.hpp"
#include "ros/roscpp/hooks.hpp"

namespace rtcf::ros1 {

class MasterWatch {
   public:
    /// @param log receives messages of ROS_* macros; outlives this object
    /// @param rosout opened and closed with the node; outlives this object
    MasterWatch(NodeName name, const executor::Access& access, executor::BridgeReport report,
                executor::Log& log, Rosout& rosout);

    /// Sets the runner, and the function that requests changes from rtcfd. Once, before
    /// configure().
    void attach(executor::RunnerView& runner, const executor::AskSupervisor& ask);

    /// @name Any thread; return at once
    /// @{
    void configure(const executor::BridgeSettings& settings);
    void setTable(const executor::BridgeTable& table);
    void setClock(std::shared_ptr<executor::SimulatedClock> clock);
    executor::BridgeStatus status() const;
    bool feeds(const executor::Injector& injector) const { return interface_.feeds(injector); }
    void serveParameters(executor::ParameterRequest request);
    /// Ends run() soon, even if the master hangs.
    void stop();
    /// @}

    /// Waits until the node is up and its master answers, at most five seconds. Any thread.
    /// @throws NoMaster
    void awaitNode();
    /// Access of components' hooks to the node; lives as long as this object.
    executor::HookGate& hooks() noexcept { return hooks_; }

    /// Serves until stop(), then leaves the master within 2 s. Called once.
    void run();

   private:
    void step();
    void serve(const executor::BridgeSettings& looked);
    void leave();
    void end();
    void wake();
    void setProblem(const std::string& problem);
    void setConnected();
    void say(const std::string& message);
    void sayLeft(std::size_t left);

    std::atomic<bool> stop_{false};

    mutable std::mutex mutex_;  // protects changed_ to status_
    std::condition_variable changed_;
    std::optional<executor::BridgeSettings> settings_;
    bool due_ = false;  // something changed since the last step
    std::uint64_t steps_begun_ = 0;
    std::uint64_t steps_ended_ = 0;
    MasterLink::Clock::time_point answered_;  // time of the master's last answer
    executor::BridgeStatus status_;

    const std::string runner_;  // name in ROS form
    const executor::BridgeReport report_;
    Hooks hooks_{[this] { awaitNode(); }};

    // Watch thread only, except for thread-safe functions.
    const ConsoleBackend console_;
    MasterLink link_;
    RosInterface interface_;
    std::string said_;
    std::string unreachable_;  // see MasterLink
};

}  // namespace rtcf::ros1
