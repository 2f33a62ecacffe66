#include "ros/calls/master_client.hpp"

#include <ros/network.h>
#include <xmlrpcpp/XmlRpcException.h>

#include <algorithm>
#include <thread>

namespace rtcf::ros1 {

namespace {

// Unpacks an answer of the ROS APIs: [code, message, value]; code 1 is success. A fault means that
// the server could not parse the call.
MasterAnswer unpack(XmlRpc::XmlRpcValue& response) {
    MasterAnswer answer;
    if (response.getType() == XmlRpc::XmlRpcValue::TypeStruct &&
        response.hasMember("faultString")) {
        answer.kind = MasterAnswer::Kind::Refused;
        XmlRpc::XmlRpcValue& why = response["faultString"];
        if (why.getType() == XmlRpc::XmlRpcValue::TypeString)
            answer.message = static_cast<std::string&>(why);
        return answer;
    }
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

MasterAnswer silence() {
    MasterAnswer answer;
    answer.message = "no answer";
    return answer;
}

// Checks a call in progress.
// @return its answer; nothing = no answer yet
std::optional<MasterAnswer> look(XmlRpc::XmlRpcClient& client, double wait_s) {
    try {
        client._disp.work(wait_s);
        XmlRpc::XmlRpcValue response;
        if (client.executeCheckDone(response)) return unpack(response);
        // The dispatcher removes a failed connection.
        if (client._disp._sources.empty()) return silence();
    } catch (const XmlRpc::XmlRpcException& error) {
        MasterAnswer answer;
        answer.message = error.getMessage();
        return answer;
    }
    return std::nullopt;
}

bool begin(XmlRpc::XmlRpcClient& client, const char* method, const XmlRpc::XmlRpcValue& arguments) {
    try {
        return client.executeNonBlock(method, arguments);
    } catch (const XmlRpc::XmlRpcException&) {
        return false;
    }
}

}  // namespace

std::string MasterAnswer::text() {
    if (value.getType() != XmlRpc::XmlRpcValue::TypeString) return {};
    return static_cast<std::string&>(value);
}

XmlRpc::XmlRpcValue texts(const std::vector<std::string>& arguments) {
    XmlRpc::XmlRpcValue value;
    value.setSize(static_cast<int>(arguments.size()));
    for (std::size_t i = 0; i < arguments.size(); ++i) value[static_cast<int>(i)] = arguments[i];
    return value;
}

MasterClient::MasterClient(const MasterAddress& server, std::chrono::milliseconds timeout,
                           const std::atomic<bool>& cancel)
    : client_(server.address.c_str(), static_cast<int>(server.port), "/"),
      timeout_(timeout),
      cancel_(cancel) {}

MasterAnswer MasterClient::call(const char* method, const XmlRpc::XmlRpcValue& arguments) {
    constexpr double kSlice = 0.05;  // s between checks of cancel_
    const auto deadline = Clock::now() + timeout_;
    if (!begin(client_, method, arguments)) return silence();
    while (!cancel_ && Clock::now() < deadline) {
        std::optional<MasterAnswer> answer = look(client_, kSlice);
        if (!answer) continue;
        if (answer->silent()) client_.close();
        return *std::move(answer);
    }
    client_.close();
    return silence();
}

struct ParallelCalls::Line {
    explicit Line(const MasterAddress& server)
        : client(server.address.c_str(), static_cast<int>(server.port), "/") {}

    XmlRpc::XmlRpcClient client;
    std::optional<std::size_t> call;  // call in progress
    Clock::time_point begun;
};

ParallelCalls::ParallelCalls(MasterAddress server, const std::atomic<bool>& cancel)
    : server_(std::move(server)), cancel_(cancel) {}

ParallelCalls::~ParallelCalls() = default;

std::vector<MasterAnswer> ParallelCalls::run(const std::vector<MasterCall>& calls,
                                             std::chrono::milliseconds each,
                                             Clock::time_point deadline) {
    constexpr std::size_t kMost = 16;  // connections
    constexpr auto kSlice = std::chrono::milliseconds(1);
    std::vector<MasterAnswer> answers(calls.size(), silence());
    while (lines_.size() < std::min(calls.size(), kMost))
        lines_.push_back(std::make_unique<Line>(server_));
    std::size_t next = 0;
    bool deaf = false;  // true = begin no more calls
    for (bool busy = true; busy;) {
        busy = false;
        deaf = deaf || cancel_ || Clock::now() > deadline;
        for (const auto& line : lines_) {
            if (!line->call && !deaf && next < calls.size()) {
                line->call = next++;
                line->begun = Clock::now();
                const MasterCall& call = calls[*line->call];
                if (!begin(line->client, call.method.c_str(), call.arguments)) {
                    line->call.reset();
                    line->client.close();
                    deaf = true;
                }
            }
            if (!line->call) continue;
            if (std::optional<MasterAnswer> answer = look(line->client, 0.0)) {
                if (answer->silent()) {
                    line->client.close();
                    deaf = true;
                }
                answers[*line->call] = *std::move(answer);
                line->call.reset();
                busy = busy || (!deaf && next < calls.size());
            } else if (cancel_ || Clock::now() > std::min(deadline, line->begun + each)) {
                line->client.close();
                line->call.reset();
                deaf = true;
            } else {
                busy = true;
            }
        }
        if (busy) std::this_thread::sleep_for(kSlice);
    }
    return answers;
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
