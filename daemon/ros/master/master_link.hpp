/// @file
/// Being a node at a ROS master: where the master is, whether it answers and is to be followed,
/// which name the node has, whether another node took it or somebody asked the node to go, and
/// that the master knows of its topics and services. What topics there are is not its matter.
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

/// Owned by the master watch, whose thread calls it unless said otherwise.
class MasterLink {
   public:
    using Clock = std::chrono::steady_clock;
    /// Says what changed, one line; the same twice counts once.
    using Say = std::function<void(const std::string&)>;

    enum class State {
        Away,    ///< no node yet, or none that may be at this master; see problem()
        Up,      ///< the master answers and knows of the node
        Silent,  ///< the master does not answer; open connections go on
        Off,     ///< the node has no right to its name, or was asked to go
        Failed,  ///< no node any more in this process
    };

    /// @param access whose masters of this machine are followed; outlives this
    /// @param wake called from any thread when look() has something to do
    /// @param written called from any thread when a parameter has been written
    MasterLink(NodeName name, const executor::Access& access, Say say,
               const std::function<void()>& wake, const RoscppNode::ParameterWritten& written);

    /// Where the settings say that the master is.
    static std::string uriOf(const executor::BridgeSettings& settings);

    /// Looks at the master and does what is to be done to be its node. Waits for one answer, a
    /// second at most.
    State look(const executor::BridgeSettings& settings);
    /// The settings were given anew: whoever asked the node to go is overruled.
    void revive();
    /// The master begins to forget of the node; leave() or end() comes next.
    void hide() { node_.registrar().show(false); }
    /// Off until the next look(): the master is to forget of the node. @return how many
    /// registrations it may still have
    std::size_t leave(Clock::time_point deadline);
    /// For good: takes everything back, and the node ends. @return as leave()
    std::size_t end(Clock::time_point deadline);

    /// Lets no call to the master take any longer. Any thread.
    void hurry() noexcept;

    /// Why it is not Up, one line; empty if it is.
    const std::string& problem() const { return problem_; }
    /// Whether a peer has asked the node to go.
    bool killed() const { return off_ == Why::Killed; }
    /// True once for each master that knows nothing of the node yet.
    bool takeNew() { return std::exchange(new_, false); }
    /// Whether the master says that time is simulated; nothing = it has not been asked.
    std::optional<bool> simulated() const { return simulated_; }
    /// Whether the master knows of the node, or may.
    bool up() const { return up_; }
    /// Whether a node of the master's answers.
    bool lives(const std::string& node);
    /// Waits until the master has been told of all topics and services, half a second at most.
    void tell();
    /// What was to be withdrawn and could not is tried again.
    void retry() { node_.registrar().retry(); }
    /// By which to call the master; what is called ends with hurry(), unless it is to leave.
    ParallelCalls calls(bool leaving = false) const {
        return {address_, leaving ? never_ : hurry_};
    }
    ParameterMirror::Caller caller() const { return {name().full(), node_.uri()}; }
    const NodeName& name() const { return node_.name(); }
    RoscppNode& node() { return node_; }

   private:
    enum class Why { No, NameTaken, Killed };
    struct Sight;

    bool mayFollow(const std::string& uri, const MasterAddress& address, executor::Right needed);
    bool locate(const std::string& uri, MasterAddress& address);
    bool start(const std::string& uri, const MasterAddress& address,
               const executor::BridgeSettings& settings);
    bool chooseName(ParallelCalls& master);
    void moveTo(const std::string& uri, const MasterAddress& address);
    void useAddress(const MasterAddress& address);
    Sight sight();
    bool takeShutdownRequest();
    bool answers(const std::string& node_uri, bool& here);
    bool mayLive(const std::string& node_uri);
    void obeyShutdownRequest(const Sight& sight);
    bool nameIsTaken(const Sight& sight);
    std::string whyOff() const;
    State away(const std::string& problem);

    const executor::Access& access_;
    const Say say_;
    std::mutex mutex_;  // shutdown_request_ and revived_
    bool shutdown_request_ = false;
    bool revived_ = false;
    std::atomic<bool> hurry_{false};
    const std::atomic<bool> never_{false};
    const NodeName own_name_;  // where settings name none
    RoscppNode node_;
    HostNames hosts_;
    std::string host_;  // of the master that the settings name
    std::string uri_;   // of the running node's master
    MasterAddress address_;
    std::unique_ptr<ParallelCalls> looks_;  // there
    std::string hostname_;                  // as it was at the node's start
    std::optional<int> master_pid_;         // of the master that was told last
    std::optional<bool> simulated_;
    Why off_ = Why::No;
    int taken_ = 0;  // looks since another node got our name, or does not answer
    bool up_ = false;
    bool was_silent_ = false;
    bool new_ = false;
    bool failed_ = false;
    std::string problem_;
};

}  // namespace rtcf::ros1
