/// @file
/// This process's roscpp node. roscpp has one per process and one start per
/// process, so there is one of these at a time; the master watch owns it, and
/// only its thread calls it unless said otherwise.
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
    /// Called with the reason when somebody asks the node to shut down: the
    /// master, for a second node of its name, or `rosnode kill`. From roscpp's threads.
    using ShutdownRequest = std::function<void(const std::string& reason)>;
    /// Called with the key when the master tells of a parameter that has been written. From
    /// roscpp's threads.
    using ParameterWritten = std::function<void(const std::string& key)>;

    RoscppNode(NodeName name, ShutdownRequest on_shutdown_request,
               ParameterWritten on_parameter_written);
    ~RoscppNode();
    RoscppNode(const RoscppNode&) = delete;
    RoscppNode& operator=(const RoscppNode&) = delete;

    const NodeName& name() const { return name_; }

    /// Another name, until the node is started.
    void rename(NodeName name) { name_ = std::move(name); }

    /// Starts the node; its master must be there.
    /// @param hostname name or address that peers are told; empty: of the environment
    /// @throws std::exception if roscpp cannot
    void start(const std::string& master_uri, const MasterAddress& address,
               const std::string& hostname);
    bool started() const { return handle_ != nullptr; }
    /// False if roscpp has been shut down by someone in this process.
    bool alive() const;

    /// Another master from now on, which knows nothing of the node yet.
    void useMaster(const std::string& master_uri, const MasterAddress& address);

    /// The URI by which peers call the node, and its port on this host.
    std::string uri() const;
    std::uint32_t port() const;

    ros::NodeHandle& handle() { return *handle_; }

    /// No master from now on: closing topics does not wait for one that has hung.
    /// Registrations are to be withdrawn before, and stop() comes next. Any thread.
    void leaveMaster() noexcept { calls_.end(); }

    /// What is said to the master by way of roscpp.
    MasterCalls& calls() noexcept { return calls_; }
    /// What it is told of topics and services.
    Registrar& registrar() noexcept { return calls_.registrar(); }

    /// Ends the node for good, without a word to any master.
    void stop();

   private:
    void connect(const std::string& topic, const XmlRpc::XmlRpcValue& publishers) const;

    NodeName name_;
    ShutdownRequest on_shutdown_request_;
    ParameterWritten on_parameter_written_;
    MasterCalls calls_;
    std::unique_ptr<ros::NodeHandle> handle_;
    std::atomic<bool> ending_{false};
    std::thread spinner_;  // of the callbacks of what components subscribe and advertise
};

}  // namespace rtcf::ros1
