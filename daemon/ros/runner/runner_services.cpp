#include "ros/runner/runner_services.hpp"

#include <ros/node_handle.h>
#include <rtcf_msgs/GetIntrospectionInformation.h>
#include <rtcf_msgs/LoadOrocosComponent.h>
#include <rtcf_msgs/UnloadOrocosComponent.h>
#include <std_srvs/Trigger.h>

#include "graph/names.hpp"
#include "ros/roscpp/quiet_thread.hpp"
#include "ros/runner/runner_report.hpp"
#include "runner/runner_view.hpp"

namespace rtcf::ros1 {

namespace {

using executor::OutsideCall;

// @return false, and says why, if a remap is not one
bool loadCall(const rtcf_msgs::LoadOrocosComponent::Request& request, OutsideCall& call,
              std::string& why) {
    call.kind = OutsideCall::Kind::Load;
    executor::ComponentDefinition& component = call.component;
    component.name = request.name;
    component.ns = request.ns;
    component.package = request.package;
    component.type = request.type;
    component.first = request.is_first != 0;
    component.ignore = request.topics_ignore_for_graph;
    for (const std::string& remap : request.remaps) {
        const std::size_t at = remap.find(":=");
        if (at == std::string::npos) {
            why = "'" + remap + "' is no remap: write it as from:=to";
            return false;
        }
        component.remaps.emplace_back(remap.substr(0, at), remap.substr(at + 2));
    }
    return true;
}

OutsideCall unloadCall(const rtcf_msgs::UnloadOrocosComponent::Request& request) {
    OutsideCall call;
    call.kind = OutsideCall::Kind::Unload;
    const bool absolute = !request.name.empty() && request.name.front() == '/';
    std::string ns = absolute || request.ns.empty() ? "/" : request.ns;
    if (ns.front() != '/') ns.insert(0, "/");
    if (ns.back() != '/') ns += '/';
    call.name = absolute ? request.name : ns + request.name;
    return call;
}

OutsideCall simpleCall(OutsideCall::Kind kind) {
    OutsideCall call;
    call.kind = kind;
    return call;
}

}  // namespace

RunnerServices::RunnerServices(const executor::RunnerView& runner, executor::AskSupervisor ask)
    : runner_(runner), ask_(std::move(ask)) {
    const auto serve = [this](ros::CallbackQueue& queue) {
        while (!stop_) queue.callOne(ros::WallDuration(0.1));
    };
    looking_ = quietThread("ros-look", [this, serve] { serve(looks_); });
    changing_ = quietThread("ros-change", [this, serve] { serve(changes_); });
    stopping_ = quietThread("ros-stop", [this, serve] { serve(stops_); });
}

RunnerServices::~RunnerServices() {
    stop_ = true;
    cancel_ = true;
    for (ros::CallbackQueue* queue : {&looks_, &changes_, &stops_}) queue->disable();
    for (std::thread* thread : {&looking_, &changing_, &stopping_}) thread->join();
}

template <typename Response>
bool RunnerServices::change(const OutsideCall& call, Response& response) {
    const executor::OutsideAnswer answer = ask_(call, cancel_);
    response.success = answer.success;
    response.message = answer.message;
    return true;
}

template <typename Service, typename Callback>
void RunnerServices::advertise(ros::NodeHandle& handle, const std::string& name,
                               ros::CallbackQueue& queue, Callback callback) {
    using Call = boost::function<bool(typename Service::Request&, typename Service::Response&)>;
    auto options = ros::AdvertiseServiceOptions::create<Service>(name, Call(callback),
                                                                 ros::VoidConstPtr(), &queue);
    servers_.push_back(handle.advertiseService(options));
}

void RunnerServices::open(ros::NodeHandle& handle, const std::string& name_space) {
    using rtcf_msgs::GetIntrospectionInformation;
    using rtcf_msgs::LoadOrocosComponent;
    using rtcf_msgs::UnloadOrocosComponent;
    using std_srvs::Trigger;
    const auto at = [&](const char* name) { return executor::joinName(name_space, name); };
    advertise<GetIntrospectionInformation>(handle, at("get_introspection_information"), looks_,
                                           [this](GetIntrospectionInformation::Request&,
                                                  GetIntrospectionInformation::Response& response) {
                                               response = describeRunner(runner_);
                                               return true;
                                           });
    advertise<LoadOrocosComponent>(
        handle, at("load_orocos_component"), changes_,
        [this](LoadOrocosComponent::Request& request, LoadOrocosComponent::Response& response) {
            OutsideCall call;
            response.success = 0;
            if (!loadCall(request, call, response.message)) return true;
            return change(call, response);
        });
    advertise<UnloadOrocosComponent>(
        handle, at("unload_orocos_component"), changes_,
        [this](UnloadOrocosComponent::Request& request, UnloadOrocosComponent::Response& response) {
            return change(unloadCall(request), response);
        });
    advertise<Trigger>(handle, at("activate_rt_loop"), changes_,
                       [this](Trigger::Request&, Trigger::Response& response) {
                           return change(simpleCall(OutsideCall::Kind::Start), response);
                       });
    // Does not wait behind a change that takes long.
    advertise<Trigger>(handle, at("deactivate_rt_loop"), stops_,
                       [this](Trigger::Request&, Trigger::Response& response) {
                           return change(simpleCall(OutsideCall::Kind::Stop), response);
                       });
}

void RunnerServices::close() {
    // A server waits for the call that it is in.
    cancel_ = true;
    for (ros::ServiceServer& server : servers_) server.shutdown();
    servers_.clear();
    cancel_ = false;
}

}  // namespace rtcf::ros1
