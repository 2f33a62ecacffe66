#include "ros/roscpp/roscpp_node.hpp"

#include <ros/callback_queue.h>
#include <ros/init.h>
#include <ros/master.h>
#include <ros/node_handle.h>
#include <ros/this_node.h>
#include <ros/xmlrpc_manager.h>
#include <xmlrpcpp/XmlRpcException.h>

#include <array>
#include <fstream>
#include <set>
#include <stdexcept>
#include <system_error>

#include "realtime/other_threads.hpp"
#include "ros/threads/quiet_thread.hpp"
#include "ros/transport/reconnection.hpp"

// Exported by roscpp, and called by itself, but in none of its headers.
namespace ros::master {
void init(const M_string& remappings);
}
namespace ros::param {
void paramUpdateCallback(XmlRpc::XmlRpcValue& parameters, XmlRpc::XmlRpcValue& result);
}

// Replaces roscpp's function: names of components without a namespace belong to "/", not to the
// namespace that the node's name needs. roscpp resolves even NodeHandle("/") against it.
namespace ros::this_node {

const std::string& getNamespace() {
    static const std::string root = "/";
    return root;
}

}  // namespace ros::this_node

namespace rtcf::ros1 {

namespace {

// Names the threads that roscpp starts, in this order; they inherit the name of the calling thread.
void nameThreads(const std::set<pid_t>& before) {
    const std::array<const char*, 3> names{"roscpp-poll", "roscpp-xmlrpc", "roscpp-queue"};
    std::size_t next = 0;
    for (const pid_t thread : executor::processThreads()) {
        if (before.count(thread) != 0 || next == names.size()) continue;
        std::ofstream file("/proc/self/task/" + std::to_string(thread) + "/comm");
        file << names.at(next++);
    }
}

// The URIs of the publishers to which this process is connected for a topic.
std::vector<std::string> connectedPublishers(MasterClient& node, const std::string& topic) {
    std::vector<std::string> uris;
    MasterAnswer answer = node.call("getBusInfo", texts({"/master"}));
    if (!answer || answer.value.getType() != XmlRpc::XmlRpcValue::TypeArray) return uris;
    for (int i = 0; i < answer.value.size(); ++i) {
        // The fields are: number, the other node, direction, transport, topic, and more.
        XmlRpc::XmlRpcValue& link = answer.value[i];
        if (static_cast<std::string&>(link[2]) == "i" &&
            static_cast<std::string&>(link[4]) == topic)
            uris.push_back(static_cast<std::string&>(link[1]));
    }
    return uris;
}

}  // namespace

RoscppNode::RoscppNode(NodeName name, ShutdownRequest on_shutdown_request,
                       ParameterWritten on_parameter_written)
    : name_(std::move(name)),
      on_shutdown_request_(std::move(on_shutdown_request)),
      on_parameter_written_(std::move(on_parameter_written)),
      calls_([this](const std::string& topic, const XmlRpc::XmlRpcValue& publishers) {
          connect(topic, publishers);
      }) {}

RoscppNode::~RoscppNode() { stop(); }

void RoscppNode::start(const std::string& master_uri, const MasterAddress& address,
                       const std::string& hostname) {
    if (ros::isShuttingDown()) throw std::runtime_error("ROS has been shut down in this process");
    calls_.useMaster(master_uri, address);
    reconnectSoon();
    ros::M_string settings{{"__master", master_uri}, {"__ns", name_.name_space}};
    if (!hostname.empty()) settings["__hostname"] = hostname;
    ros::init(settings, name_.base,
              ros::init_options::NoSigintHandler | ros::init_options::NoRosout);
    const std::set<pid_t> before = executor::processThreads();
    try {
        ros::start();
        nameThreads(before);
    } catch (const XmlRpc::XmlRpcException& error) {  // not a std::exception
        throw std::runtime_error("cannot parse the master's answer: " + error.getMessage());
    }

    // Replaces roscpp's handler of shutdown requests, which cannot be undone in this process.
    const auto& server = ros::XMLRPCManager::instance();
    server->unbind("shutdown");
    const ShutdownRequest request = on_shutdown_request_;
    server->bind(
        "shutdown", [request](XmlRpc::XmlRpcValue& parameters, XmlRpc::XmlRpcValue& result) {
            std::string reason;
            if (parameters.getType() == XmlRpc::XmlRpcValue::TypeArray && parameters.size() > 1 &&
                parameters[1].getType() == XmlRpc::XmlRpcValue::TypeString) {
                reason = static_cast<std::string&>(parameters[1]);
            }
            request(reason);
            result[0] = 1;
            result[1] = std::string();
            result[2] = 0;
        });
    server->unbind("paramUpdate");
    server->bind("paramUpdate", [written = on_parameter_written_](XmlRpc::XmlRpcValue& parameters,
                                                                  XmlRpc::XmlRpcValue& result) {
        ros::param::paramUpdateCallback(parameters, result);  // for components that cache them
        written(static_cast<std::string&>(parameters[1]));
    });
    handle_ = std::make_unique<ros::NodeHandle>("/");
    spinner_ = quietThread("ros-spin", [this] {
        while (!ending_) ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.1));
    });
}

bool RoscppNode::alive() const { return ros::ok() && !ros::isShuttingDown(); }

void RoscppNode::useMaster(const std::string& master_uri, const MasterAddress& address) {
    calls_.useMaster(master_uri, address);
    ros::master::init({{"__master", master_uri}});  // components may query it from roscpp
}

std::string RoscppNode::uri() const { return ros::XMLRPCManager::instance()->getServerURI(); }

std::uint32_t RoscppNode::port() const { return ros::XMLRPCManager::instance()->getServerPort(); }

// Calls publisherUpdate of this node, as the master does when publishers come or go. The master may
// have done so after this answer, so present connections stay until the next update.
void RoscppNode::connect(const std::string& topic, const XmlRpc::XmlRpcValue& publishers) const {
    if (publishers.size() == 0) return;
    for (int i = 0; i < publishers.size(); ++i) {
        // An answer of a master must never end the executor.
        if (publishers[i].getType() != XmlRpc::XmlRpcValue::TypeString) return;
    }
    constexpr auto kTimeout = std::chrono::milliseconds(1000);
    const std::atomic<bool> never{false};
    const MasterAddress here{"127.0.0.1", port()};
    XmlRpc::XmlRpcValue update = texts({"/master", topic, ""});
    update[2] = publishers;
    MasterClient asking(here, kTimeout, never);
    for (const std::string& uri : connectedPublishers(asking, topic)) {
        int i = 0;
        while (i < update[2].size() && static_cast<std::string&>(update[2][i]) != uri) ++i;
        update[2][i] = uri;
    }
    MasterClient(here, kTimeout, never).call("publisherUpdate", update);
}

void RoscppNode::stop() {
    leaveMaster();
    if (!handle_) return;
    ending_ = true;
    spinner_.join();
    handle_.reset();
    ros::shutdown();
}

}  // namespace rtcf::ros1
