#include "ros/roscpp_node.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <ros/init.h>
#include <ros/master.h>
#include <ros/names.h>
#include <ros/network.h>
#include <ros/node_handle.h>
#include <ros/service_manager.h>
#include <ros/xmlrpc_manager.h>
#include <sys/socket.h>
#include <unistd.h>
#include <xmlrpcpp/XmlRpcException.h>

#include <stdexcept>

// Exported by roscpp, and called by its ros::init(), but in none of its headers.
namespace ros::master {
void init(const M_string& remappings);
}

namespace rtcf::ros1 {

// A port on this host that refuses connections as long as this lives. roscpp
// waits for its master without bound, except for one that refuses.
class DeadEnd {
   public:
    DeadEnd() : socket_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
        address_.sin_family = AF_INET;
        address_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        socklen_t size = sizeof address_;
        // Bound but not listening: nobody else gets the port, nobody can connect.
        if (socket_ < 0 || bind(socket_, reinterpret_cast<sockaddr*>(&address_), size) != 0 ||
            getsockname(socket_, reinterpret_cast<sockaddr*>(&address_), &size) != 0) {
            address_.sin_port = htons(1);  // tcpmux, which nobody serves
        }
    }
    ~DeadEnd() {
        if (socket_ >= 0) close(socket_);
    }
    DeadEnd(const DeadEnd&) = delete;
    DeadEnd& operator=(const DeadEnd&) = delete;

    std::string uri() const {
        return "http://127.0.0.1:" + std::to_string(ntohs(address_.sin_port));
    }

   private:
    int socket_;
    sockaddr_in address_{};
};

bool splitMasterUri(const std::string& uri, std::string& host, std::uint32_t& port) {
    if (uri.rfind("http://", 0) != 0) return false;
    try {
        return ros::network::splitURI(uri, host, port) && !host.empty() && port > 0 && port < 65536;
    } catch (const std::exception&) {
        return false;
    }
}

RoscppNode::RoscppNode(NodeName name, ShutdownRequest on_shutdown_request)
    : name_(std::move(name)), on_shutdown_request_(std::move(on_shutdown_request)) {}

RoscppNode::~RoscppNode() { stop(); }

void RoscppNode::start(const std::string& master_uri) {
    if (ros::isShuttingDown()) throw std::runtime_error("ROS has been shut down in this process");
    const ros::M_string settings{{"__master", master_uri}, {"__ns", name_.name_space}};
    ros::init(settings, name_.base,
              ros::init_options::NoSigintHandler | ros::init_options::NoRosout);
    // A call that roscpp repeats until the master is there holds up everything else.
    ros::master::setRetryTimeout(ros::WallDuration(0.2));
    try {
        ros::start();
    } catch (const XmlRpc::XmlRpcException& error) {  // not a std::exception
        throw std::runtime_error("the master's answer is not understood: " + error.getMessage());
    }

    // Debian 12's get_loggers() corrupts log4cxx: the next log call would crash.
    const auto& services = ros::ServiceManager::instance();
    services->unadvertiseService(ros::names::resolve("~get_loggers"));

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
    handle_ = std::make_unique<ros::NodeHandle>("/");
}

bool RoscppNode::alive() const { return ros::ok() && !ros::isShuttingDown(); }

void RoscppNode::useMaster(const std::string& master_uri) {
    ros::master::init({{"__master", master_uri}});
}

std::string RoscppNode::uri() const { return ros::XMLRPCManager::instance()->getServerURI(); }

std::uint32_t RoscppNode::port() const { return ros::XMLRPCManager::instance()->getServerPort(); }

void RoscppNode::leaveMaster() {
    if (!nowhere_) nowhere_ = std::make_unique<DeadEnd>();
    useMaster(nowhere_->uri());
}

void RoscppNode::stop() {
    if (!handle_) return;
    if (alive()) leaveMaster();
    handle_.reset();
    ros::shutdown();
}

}  // namespace rtcf::ros1
