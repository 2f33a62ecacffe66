#include "ros/roscpp/roscpp_node.hpp"

#include <ros/callback_queue.h>
#include <ros/init.h>
#include <ros/master.h>
#include <ros/node_handle.h>
#include <ros/this_node.h>
#include <ros/xmlrpc_manager.h>
#include <xmlrpcpp/XmlRpcException.h>

#include <stdexcept>

#include "ros/roscpp/quiet_thread.hpp"
#include "ros/roscpp/reconnection.hpp"

// Exported by roscpp, and called by itself, but in none of its headers.
namespace ros::master {
void init(const M_string& remappings);
}
namespace ros::param {
void paramUpdateCallback(XmlRpc::XmlRpcValue& parameters, XmlRpc::XmlRpcValue& result);
}

// Takes the place of roscpp's own: what components do without a namespace of
// theirs is to be in "/", not in the one that our node's name needs. roscpp
// resolves even NodeHandle("/") against this.
namespace ros::this_node {

const std::string& getNamespace() {
    static const std::string root = "/";
    return root;
}

}  // namespace ros::this_node

namespace rtcf::ros1 {

RoscppNode::RoscppNode(NodeName name, ShutdownRequest on_shutdown_request,
                       ParameterWritten on_parameter_written)
    : name_(std::move(name)),
      on_shutdown_request_(std::move(on_shutdown_request)),
      on_parameter_written_(std::move(on_parameter_written)) {}

RoscppNode::~RoscppNode() { stop(); }

void RoscppNode::start(const std::string& master_uri, const std::string& hostname) {
    if (ros::isShuttingDown()) throw std::runtime_error("ROS has been shut down in this process");
    calls_.useMaster(master_uri);
    reconnectSoon();
    ros::M_string settings{{"__master", master_uri}, {"__ns", name_.name_space}};
    if (!hostname.empty()) settings["__hostname"] = hostname;
    ros::init(settings, name_.base,
              ros::init_options::NoSigintHandler | ros::init_options::NoRosout);
    try {
        ros::start();
    } catch (const XmlRpc::XmlRpcException& error) {  // not a std::exception
        throw std::runtime_error("the master's answer is not understood: " + error.getMessage());
    }

    // roscpp's own answer to a request to shut down cannot be undone in this process.
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

void RoscppNode::useMaster(const std::string& master_uri) {
    calls_.useMaster(master_uri);
    ros::master::init({{"__master", master_uri}});  // what components may ask roscpp for
}

std::string RoscppNode::uri() const { return ros::XMLRPCManager::instance()->getServerURI(); }

std::uint32_t RoscppNode::port() const { return ros::XMLRPCManager::instance()->getServerPort(); }

void RoscppNode::stop() {
    leaveMaster();
    if (!handle_) return;
    ending_ = true;
    spinner_.join();
    handle_.reset();
    ros::shutdown();
}

}  // namespace rtcf::ros1
