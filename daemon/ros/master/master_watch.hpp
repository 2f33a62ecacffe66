/// @file
/// The life of the node: waits for a master, has what the runner shows opened and closed at it,
/// lets hooks through to it, and ends it all in order. The ROS node owns it; run() has a thread of
/// its own.
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
#include "ros/master/subjects.hpp"
#include "ros/roscpp/hooks.hpp"

namespace rtcf::ros1 {

class MasterWatch {
   public:
    /// @param log what is said by ROS_* macros goes there; outlives this
    /// @param rosout opened and closed with the node; outlives this
    MasterWatch(NodeName name, const executor::Access& access, executor::BridgeReport report,
                executor::Log& log, Rosout& rosout);

    /// Once, before configure(): the runner to show, and whom to ask for changes of it.
    void attach(executor::RunnerView& runner, const executor::AskSupervisor& ask);

    /// @name Any thread; return at once
    /// @{
    void configure(const executor::BridgeSettings& settings);
    void setTable(const executor::BridgeTable& table);
    void setClock(std::shared_ptr<executor::SimulatedClock> clock);
    executor::BridgeStatus status() const;
    bool feeds(const executor::Injector& injector) const { return subjects_.feeds(injector); }
    void serveParameters(executor::ParameterRequest request);
    /// Lets run() end, soon whatever the master does.
    void stop();
    /// @}

    /// Waits until the node is up and its master answers, at most some seconds. Any thread.
    /// @throws NoMaster
    void awaitNode();
    /// By which components' hooks come to the node; as long as this.
    executor::HookGate& hooks() noexcept { return hooks_; }

    /// Serves until stop(). Called once. Leaves the master within 2 s.
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

    mutable std::mutex mutex_;  // down to status_
    std::condition_variable changed_;
    std::optional<executor::BridgeSettings> settings_;
    bool due_ = false;  // something changed since the last step
    std::uint64_t steps_begun_ = 0;
    std::uint64_t steps_ended_ = 0;
    MasterLink::Clock::time_point answered_;  // when the master did, last
    executor::BridgeStatus status_;

    const std::string runner_;  // as ROS may write it
    const executor::BridgeReport report_;
    Hooks hooks_{[this] { awaitNode(); }};

    // The watch thread's alone, but for what is thread-safe in itself.
    const ConsoleBackend console_;
    MasterLink link_;
    Subjects subjects_;
    std::string said_;
};

}  // namespace rtcf::ros1
