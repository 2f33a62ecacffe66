/// @file
/// This process's roscpp node. roscpp allows one node and one start per process, so there is one of
/// these objects at a time. Owned by the master watch; watch thread, unless stated otherwise.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "ros/calls/master_calls.hpp"
#include "ros/roscpp/node_name.hpp"

namespace ros {
class NodeHandle;
}

namespace rtcf::ros1 {

class RoscppNode {
   public:
    /// Called with the reason of a shutdown request: from the master, for a second node of the same
    /// name, or from `rosnode kill`. In roscpp's threads.
    using ShutdownRequest = std::function<void(const std::string& reason)>;
    /// Called with the key when the master reports a written parameter. In roscpp's threads.
    using ParameterWritten = std::function<void(const std::string& key)>;

    RoscppNode(NodeName name, ShutdownRequest on_shutdown_request,
               ParameterWritten on_parameter_written);
    ~RoscppNode();
    RoscppNode(const RoscppNode&) = delete;
    RoscppNode& operator=(const RoscppNode&) = delete;

    const NodeName& name() const { return name_; }

    /// Changes the name; before start().
    void rename(NodeName name) { name_ = std::move(name); }

    /// Starts the node; its master must be there.
    /// @param hostname name or address of this host for peers; empty = from the environment
    /// @throws std::exception if roscpp fails
    void start(const std::string& master_uri, const MasterAddress& address,
               const std::string& hostname);
    bool started() const { return handle_ != nullptr; }
    /// False if something in this process has shut down roscpp.
    bool alive() const;

    /// Sets a new master, at which nothing is registered yet.
    void useMaster(const std::string& master_uri, const MasterAddress& address);

    /// The URI by which peers call the node, and its port on this host.
    std::string uri() const;
    std::uint32_t port() const;

    ros::NodeHandle& handle() { return *handle_; }

    /// Ends calls to the master, so that closing topics does not wait for a hanging one.
    /// Registrations must be withdrawn before; stop() comes next. Any thread.
    void leaveMaster() noexcept { calls_.end(); }

    /// roscpp's calls to the master.
    MasterCalls& calls() noexcept { return calls_; }
    /// The registrations of topics and services.
    Registrar& registrar() noexcept { return calls_.registrar(); }

    /// Ends the node for good, without calls to a master.
    void stop();

   private:
    void connect(const std::string& topic, const XmlRpc::XmlRpcValue& publishers) const;

    NodeName name_;
    ShutdownRequest on_shutdown_request_;
    ParameterWritten on_parameter_written_;
    MasterCalls calls_;
    std::unique_ptr<ros::NodeHandle> handle_;
    std::atomic<bool> ending_{false};
    std::thread spinner_;  // runs callbacks of components' own subscriptions and services
};

}  // namespace rtcf::ros1
