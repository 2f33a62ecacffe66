#include "ros/roscpp/master_client.hpp"

#include <ros/network.h>
#include <xmlrpcpp/XmlRpcException.h>

namespace rtcf::ros1 {

namespace {

// Answers of the ROS APIs are [code, message, value]; 1 is success.
MasterAnswer unpack(XmlRpc::XmlRpcValue& response) {
    MasterAnswer answer;
    if (response.getType() != XmlRpc::XmlRpcValue::TypeArray || response.size() != 3 ||
        response[0].getType() != XmlRpc::XmlRpcValue::TypeInt) {
        answer.message = "it does not answer like a ROS master";
        return answer;
    }
    const bool success = static_cast<int&>(response[0]) == 1;
    answer.kind = success ? MasterAnswer::Kind::Success : MasterAnswer::Kind::Refused;
    if (response[1].getType() == XmlRpc::XmlRpcValue::TypeString) {
        answer.message = static_cast<std::string&>(response[1]);
    }
    answer.value = response[2];
    return answer;
}

}  // namespace

std::string MasterAnswer::text() {
    if (value.getType() != XmlRpc::XmlRpcValue::TypeString) return {};
    return static_cast<std::string&>(value);
}

MasterClient::MasterClient(const std::string& host, std::uint32_t port,
                           std::chrono::milliseconds timeout, const std::atomic<bool>& cancel)
    : client_(host.c_str(), static_cast<int>(port), "/"), timeout_(timeout), cancel_(cancel) {}

MasterAnswer MasterClient::call(const char* method, const XmlRpc::XmlRpcValue& arguments) {
    constexpr double kSlice = 0.05;  // s, between looks at cancel_
    MasterAnswer answer;
    answer.message = "no answer";
    const auto deadline = std::chrono::steady_clock::now() + timeout_;
    try {
        if (!client_.executeNonBlock(method, arguments)) return answer;
        XmlRpc::XmlRpcValue response;
        while (!cancel_ && std::chrono::steady_clock::now() < deadline) {
            client_._disp.work(kSlice);
            if (client_.executeCheckDone(response)) return unpack(response);
            // The dispatcher lets go of a connection that failed.
            if (client_._disp._sources.empty()) break;
        }
    } catch (const XmlRpc::XmlRpcException& error) {
        answer.message = error.getMessage();
    }
    client_.close();
    return answer;
}

bool splitMasterUri(const std::string& uri, std::string& host, std::uint32_t& port) {
    if (uri.rfind("http://", 0) != 0) return false;
    try {
        return ros::network::splitURI(uri, host, port) && !host.empty() && port > 0 && port < 65536;
    } catch (const std::exception&) {
        return false;
    }
}

}  // namespace rtcf::ros1
