#include "ros/calls/master_calls.hpp"

#include <ros/master.h>

#include <chrono>
#include <utility>

namespace rtcf::ros1 {

namespace {

constexpr auto kTimeout = std::chrono::milliseconds(1000);
constexpr std::int64_t kDeafness = 1000;  // ms
constexpr std::int64_t kRecent = 10'000;  // ms

// Global, because roscpp calls a function without an object.
std::atomic<MasterCalls*> current_calls{nullptr};

struct Note {
    bool open = false;
    bool registered = false;
    std::string unanswered;
};
thread_local Note note;

std::int64_t nowMs() {
    return std::chrono::duration_cast<std::chrono::milliseconds>(
               std::chrono::steady_clock::now().time_since_epoch())
        .count();
}

// Detects the five calls about statistics that roscpp makes for each subscription.
// @return a key for the call; empty for other calls
std::string aboutStatistics(const std::string& method, const XmlRpc::XmlRpcValue& arguments) {
    if (method != "hasParam" && method != "getParam") return {};
    XmlRpc::XmlRpcValue values = arguments;
    const auto& key = static_cast<std::string&>(values[1]);
    if (key != "/enable_statistics" && key.rfind("/statistics_window_", 0) != 0) return {};
    return method + key;
}

std::string silence(const std::string& uri, const std::string& what) {
    return "no ROS master answers at " + uri + " (" + what +
           "): start one (roscore), or load with --wait";
}

}  // namespace

MasterCalls::MasterCalls(Registrar::Connect connect) : registrar_(std::move(connect)) {
    current_calls = this;
}

MasterCalls::~MasterCalls() { current_calls = nullptr; }

MasterCalls* MasterCalls::current() noexcept { return current_calls; }

void MasterCalls::beginNote() noexcept {
    note.open = true;
    note.registered = false;
    note.unanswered.clear();
}

std::string MasterCalls::endNote() noexcept {
    constexpr auto kPatience = std::chrono::seconds(5);  // for a slow master and many registrations
    note.open = false;
    MasterCalls* const calls = current();
    if (note.registered && note.unanswered.empty() && calls != nullptr && !calls->ended_ &&
        !calls->registrar_.flush(Registrar::Clock::now() + kPatience)) {
        const std::lock_guard lock(calls->mutex_);
        note.unanswered = silence(calls->uri_, "registrations");
    }
    return std::move(note.unanswered);
}

void MasterCalls::useMaster(const std::string& uri, const MasterAddress& address) {
    {
        const std::lock_guard lock(mutex_);
        uri_ = uri;
        recent_.clear();
    }
    moveTo(address);
    registrar_.forget();
}

void MasterCalls::moveTo(const MasterAddress& address) {
    {
        const std::lock_guard lock(mutex_);
        address_ = address;
    }
    deaf_until_ms_ = 0;
    registrar_.useMaster(address);
}

bool MasterCalls::call(const std::string& method, const XmlRpc::XmlRpcValue& arguments,
                       XmlRpc::XmlRpcValue& value) {
    if (registrar_.note(method, arguments)) {
        note.registered = true;
        value.setSize(0);  // no publishers yet; the registrar connects them when the master answers
        return true;
    }
    MasterAnswer answer;
    const std::int64_t begin = nowMs();
    const std::string repeated = aboutStatistics(method, arguments);
    if (!repeated.empty()) {
        const std::lock_guard lock(mutex_);
        const auto found = recent_.find(repeated);
        if (found != recent_.end() && begin - found->second.at_ms < kRecent) {
            value = found->second.answer.value;
            return static_cast<bool>(found->second.answer);
        }
    }
    // After a timeout, calls fail at once for a while, so that a hundred calls do not wait one
    // after another.
    if (!ended_ && begin >= deaf_until_ms_) {
        MasterAddress address;
        {
            const std::lock_guard lock(mutex_);
            address = address_;
        }
        MasterClient master(address, kTimeout, ended_);
        answer = master.call(method.c_str(), arguments);
        if (answer.silent() && nowMs() - begin >= kTimeout.count())
            deaf_until_ms_ = nowMs() + kDeafness;
    }
    if (answer.silent()) {
        if (note.open && note.unanswered.empty()) {
            const std::lock_guard lock(mutex_);
            note.unanswered = silence(uri_, method);
        }
        return false;
    }
    if (!repeated.empty()) {
        const std::lock_guard lock(mutex_);
        recent_[repeated] = {answer, begin};
    }
    value = answer.value;
    return static_cast<bool>(answer);
}

}  // namespace rtcf::ros1

namespace ros::master {

// Replaces roscpp's function of this name.
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
