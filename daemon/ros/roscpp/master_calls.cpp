#include "ros/roscpp/master_calls.hpp"

#include <ros/master.h>

#include <chrono>
#include <stdexcept>
#include <utility>

#include "ros/roscpp/master_client.hpp"

namespace rtcf::ros1 {

namespace {

constexpr auto kTimeout = std::chrono::milliseconds(1000);
constexpr std::int64_t kDeafness = 1000;  // ms

// roscpp calls a function, not an object.
std::atomic<MasterCalls*> current_calls{nullptr};

struct Note {
    bool open = false;
    std::string unanswered;
};
thread_local Note note;

std::int64_t nowMs() {
    return std::chrono::duration_cast<std::chrono::milliseconds>(
               std::chrono::steady_clock::now().time_since_epoch())
        .count();
}

bool registers(const std::string& method) {
    return method.rfind("register", 0) == 0 || method.rfind("unregister", 0) == 0;
}

}  // namespace

MasterCalls::MasterCalls() { current_calls = this; }

MasterCalls::~MasterCalls() { current_calls = nullptr; }

MasterCalls* MasterCalls::current() noexcept { return current_calls; }

void MasterCalls::beginNote() noexcept {
    note.open = true;
    note.unanswered.clear();
}

std::string MasterCalls::endNote() noexcept {
    note.open = false;
    return std::move(note.unanswered);
}

void MasterCalls::useMaster(const std::string& uri) {
    const std::lock_guard lock(mutex_);
    if (!splitMasterUri(uri, host_, port_))
        throw std::invalid_argument("'" + uri + "' is no ROS master's URI");
    uri_ = uri;
    deaf_until_ms_ = 0;
}

std::map<std::string, std::string> MasterCalls::services() const {
    const std::lock_guard lock(mutex_);
    return services_;
}

void MasterCalls::noteService(const std::string& method, const XmlRpc::XmlRpcValue& arguments) {
    if (method != "registerService" && method != "unregisterService") return;
    XmlRpc::XmlRpcValue values = arguments;
    const std::lock_guard lock(mutex_);
    if (method == "registerService") {
        services_[values[1]] = static_cast<std::string&>(values[2]);
    } else {
        services_.erase(values[1]);
    }
}

bool MasterCalls::call(const std::string& method, const XmlRpc::XmlRpcValue& arguments,
                       XmlRpc::XmlRpcValue& value) {
    noteService(method, arguments);
    MasterAnswer answer;
    const std::int64_t begin = nowMs();
    // One that hangs is not waited for again by each of a hundred topics that close.
    if (!ended_ && begin >= deaf_until_ms_) {
        std::string host;
        std::uint32_t port = 0;
        {
            const std::lock_guard lock(mutex_);
            host = host_;
            port = port_;
        }
        MasterClient master(host, port, kTimeout, ended_);
        answer = master.call(method.c_str(), arguments);
        if (answer.silent() && nowMs() - begin >= kTimeout.count())
            deaf_until_ms_ = nowMs() + kDeafness;
    }
    if (answer.silent()) {
        if (registers(method)) missed_ = true;
        if (note.open && note.unanswered.empty()) {
            const std::lock_guard lock(mutex_);
            note.unanswered = "no ROS master answers at " + uri_ + " (" + method +
                              "): start one (roscore), or load with --wait";
        }
        return false;
    }
    value = answer.value;
    return bool(answer);
}

}  // namespace rtcf::ros1

namespace ros::master {

// Takes the place of roscpp's own, which its other parts call by this name.
bool execute(const std::string& method, const XmlRpc::XmlRpcValue& request,
             XmlRpc::XmlRpcValue& response, XmlRpc::XmlRpcValue& payload,
             bool /*wait_for_master*/) {
    rtcf::ros1::MasterCalls* const calls = rtcf::ros1::MasterCalls::current();
    if (calls == nullptr) return false;
    XmlRpc::XmlRpcValue value;
    const bool done = calls->call(method, request, value);
    response[0] = done ? 1 : 0;
    response[1] = std::string();
    response[2] = value;
    if (done) payload = value;
    return done;
}

}  // namespace ros::master
