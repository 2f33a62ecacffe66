/// @file
/// The node's relation to a ROS master: the master's address and state, whether its owner is
/// trusted, the node's name and whether another node has taken it, shutdown requests, and the
/// registrations of topics and services. It does not know which topics exist.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "access/rights.hpp"
#include "bridge/bridge.hpp"
#include "ros/calls/host_names.hpp"
#include "ros/calls/master_client.hpp"
#include "ros/parameters/parameter_mirror.hpp"
#include "ros/roscpp/roscpp_node.hpp"

namespace rtcf::ros1 {

/// Owned by the master watch. Watch thread, unless stated otherwise.
class MasterLink {
   public:
    using Clock = std::chrono::steady_clock;
    /// Reports a change, one line; a repetition counts once.
    using Say = std::function<void(const std::string&)>;

    enum class State {
        Away,    ///< no node yet, or this master is not trusted; see problem()
        Up,      ///< the master answers, and the node is registered
        Silent,  ///< the master does not answer; open connections continue
        Off,     ///< another node has the name, or a peer requested a shutdown
        Failed,  ///< roscpp has been shut down in this process
    };

    /// @param access rights of users, which decide on masters of this machine; outlives this object
    /// @param wake called from any thread when look() has something to do
    /// @param written called from any thread when a parameter has been written
    MasterLink(NodeName name, const executor::Access& access, Say say,
               const std::function<void()>& wake, const RoscppNode::ParameterWritten& written);

    /// The master's URI of the settings.
    static std::string uriOf(const executor::BridgeSettings& settings);

    /// Checks the master, and starts or registers the node as necessary. Waits for one answer, a
    /// second at most.
    State look(const executor::BridgeSettings& settings);
    /// Cancels a shutdown request of a peer, because the settings were set again.
    void revive();
    /// Begins to withdraw registrations; leave() or end() comes next.
    void hide() { node_.registrar().show(false); }
    /// Withdraws all registrations; the node is off until the next look().
    /// @return number of registrations that the master may still have
    std::size_t leave(Clock::time_point deadline);
    /// Withdraws all registrations and ends the node for good.
    /// @return as leave()
    std::size_t end(Clock::time_point deadline);

    /// Ends all calls to the master soon. Any thread.
    void hurry() noexcept;

    /// The reason for a state other than Up, one line; empty = Up.
    const std::string& problem() const { return problem_; }
    /// The reason why peers cannot connect to the node by the address that it advertises; empty =
    /// none is known. Waits half a second at most.
    std::string unreachable();
    /// True if a peer has requested a shutdown.
    bool killed() const { return off_ == Why::Killed; }
    /// True once for each master at which the node is new.
    bool takeNew() { return std::exchange(new_, false); }
    /// The master's /use_sim_time; nothing = not queried yet.
    std::optional<bool> simulated() const { return simulated_; }
    /// True if the node is, or may be, registered.
    bool up() const { return up_; }
    /// True if a node of the master answers.
    bool lives(const std::string& node);
    /// Waits until all topics and services are registered, half a second at most.
    void awaitRegistrations();
    /// Retries failed withdrawals.
    void retry() { node_.registrar().retry(); }
    /// For calls to the master. They end with hurry(), unless `leaving` is true.
    ParallelCalls calls(bool leaving = false) const {
        return {address_, leaving ? never_ : hurry_};
    }
    ParameterMirror::Caller caller() const { return {name().full(), node_.uri()}; }
    const NodeName& name() const { return node_.name(); }
    RoscppNode& node() { return node_; }

   private:
    enum class Why { No, NameTaken, Killed };
    struct CheckResult;

    bool mayFollow(const std::string& uri, const MasterAddress& address, executor::Right needed);
    bool locate(const std::string& uri, MasterAddress& address);
    bool start(const std::string& uri, const MasterAddress& address,
               const executor::BridgeSettings& settings);
    bool chooseName(ParallelCalls& master);
    void moveTo(const std::string& uri, const MasterAddress& address);
    void useAddress(const MasterAddress& address);
    CheckResult check();
    bool takeShutdownRequest();
    bool answers(const std::string& node_uri, bool& here);
    bool mayLive(const std::string& node_uri);
    void obeyShutdownRequest(const CheckResult& found);
    bool nameIsTaken(const CheckResult& found);
    std::string whyOff() const;
    State away(const std::string& problem);

    const executor::Access& access_;
    const Say say_;
    std::mutex mutex_;  // protects shutdown_request_ and revived_
    bool shutdown_request_ = false;
    bool revived_ = false;
    std::atomic<bool> hurry_{false};
    const std::atomic<bool> never_{false};
    const NodeName own_name_;  // without a name in the settings
    RoscppNode node_;
    HostNames hosts_;
    std::string host_;  // host of the configured master
    std::string uri_;   // URI of the running node's master
    MasterAddress address_;
    std::unique_ptr<ParallelCalls> looks_;  // calls to the master, for checks
    std::string hostname_;                  // as at the node's start
    std::optional<int> master_pid_;         // of the last master with our registrations
    std::optional<bool> simulated_;
    Why off_ = Why::No;
    int taken_ = 0;  // checks since another node got our name, or since it stopped answering
    bool up_ = false;
    bool was_silent_ = false;
    bool new_ = false;
    bool failed_ = false;
    std::string problem_;
};

}  // namespace rtcf::ros1
