/// @file
/// The life of the node: waits for a master, starts the node, opens and closes
/// its topics, notices when the master goes and comes, and ends it all in
/// order. The ROS node owns it; run() has a thread of its own.
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
#include "ros/master/registration.hpp"
#include "ros/reconfigure/reconfiguring.hpp"
#include "ros/roscpp/hooks.hpp"
#include "ros/roscpp/master_client.hpp"
#include "ros/roscpp/refusals.hpp"
#include "ros/roscpp/roscpp_node.hpp"
#include "ros/runner/introspection.hpp"
#include "ros/topics/publishing.hpp"
#include "ros/topics/subscribing.hpp"

namespace rtcf::ros1 {

class MasterWatch {
   public:
    /// @param log what is said by ROS_* macros goes there; outlives this
    /// @param rosout opened and closed with the node; outlives this
    MasterWatch(const std::string& runner, executor::BridgeReport report, executor::Log& log,
                Rosout& rosout);

    /// Once, before configure(): the runner to show, and whom to ask for changes of it.
    void attach(executor::RunnerView& runner, const executor::AskSupervisor& ask);

    /// @name Any thread; return at once
    /// @{
    void configure(const executor::BridgeSettings& settings);
    void setTable(const executor::BridgeTable& table);
    void setClock(std::shared_ptr<executor::SimulatedClock> clock);
    executor::BridgeStatus status() const;
    void serveParameters(executor::ParameterRequest request);
    /// Lets run() end, soon whatever the master does.
    void stop();
    /// @}

    /// Waits until the node is up and its master answers, at most some seconds. Any thread.
    /// @throws NoMaster
    void awaitNode();
    /// By which components' hooks come to the node; as long as this.
    executor::HookGate& hooks() noexcept { return hooks_; }

    /// Serves until stop(). Called once.
    void run();

   private:
    // Why the node is off although it is enabled.
    enum class Off { No, NameTaken, Killed };

    void step();
    bool startNode(const std::string& uri, const std::string& hostname);
    void changeMaster(const std::string& uri);
    void obeyShutdownRequest(MasterClient& master);
    bool watchMaster(MasterClient& master);
    void openAndClose(MasterClient& master, const executor::BridgeSettings& settings);
    bool leaveTopics(MasterClient& master);
    bool nameIsTaken(const Lookup& found);
    std::string whyOff() const;
    std::optional<int> pidOf(MasterClient& master) const;
    void end();
    ParameterMirror::Caller caller() const;
    MasterClient self() const;

    void setProblem(const std::string& problem);
    void setConnected();
    void askForSimulation(MasterClient& master);
    void say(const std::string& message);

    const NodeName name_;
    std::atomic<bool> stop_{false};

    mutable std::mutex mutex_;  // down to status_
    std::condition_variable changed_;
    std::optional<executor::BridgeSettings> settings_;
    std::optional<std::string> shutdown_request_;
    bool revived_ = false;  // configured anew since it was killed
    bool due_ = false;      // something changed since the last step
    std::uint64_t steps_begun_ = 0;
    std::uint64_t steps_ended_ = 0;
    executor::BridgeStatus status_;

    const executor::BridgeReport report_;
    executor::Log& log_;
    Hooks hooks_{[this] { awaitNode(); }};

    // The watch thread's alone, but for what is thread-safe in itself.
    const ConsoleBackend console_;
    Rosout& rosout_;
    RoscppNode node_;
    Publishing publishing_;
    Subscribing subscribing_;
    Reconfiguring reconfiguring_;
    std::unique_ptr<Introspection> introspection_;  // null without a runner
    std::unique_ptr<Refusals> refusals_;
    std::string master_uri_;         // of the running node
    std::string hostname_;           // as it was at the node's start
    std::optional<int> master_pid_;  // of the master that has our registrations
    bool registered_ = false;        // everything that is open, as far as we know
    bool was_silent_ = false;        // the master, at the last step
    bool simulated_ = false;         // time, as the master said last
    int taken_ = 0;                  // steps since another node got our name, or does not answer
    bool failed_ = false;            // the node cannot be started in this process
    Off off_ = Off::No;
    std::string said_;
};

}  // namespace rtcf::ros1
