#include "ros/runner/runner_services.hpp"

#include <ros/node_handle.h>
#include <rtcf_msgs/GetLoop.h>
#include <rtcf_msgs/GetRunnerInfo.h>
#include <rtcf_msgs/LoadComponent.h>
#include <rtcf_msgs/LoadOrocosComponent.h>
#include <rtcf_msgs/UnloadComponent.h>
#include <rtcf_msgs/UnloadOrocosComponent.h>
#include <std_srvs/Trigger.h>

#include <algorithm>

#include "common/error.hpp"
#include "names/name_pattern.hpp"
#include "names/names.hpp"
#include "ros/runner/runner_report.hpp"
#include "ros/threads/quiet_thread.hpp"
#include "view/runner_view.hpp"

namespace rtcf::ros1 {

namespace {

using executor::OutsideCall;

// Sets a component's name from base name and namespace, or from a full name alone, as from RTCF
// 2021's rt_launcher.
void setName(executor::ComponentDefinition& component, const std::string& name,
             const std::string& name_space) {
    const std::size_t slash = name.rfind('/');
    const bool full = !name.empty() && name.front() == '/';
    component.name = full ? name.substr(slash + 1) : name;
    component.ns = full ? name.substr(0, std::max<std::size_t>(slash, 1)) : name_space;
}

// @return false and sets `why` if the expression is invalid
bool setBreaks(executor::ComponentDefinition& component, bool first, const std::string& ignore,
               std::string& why) {
    component.breaks.first = first;
    try {
        component.breaks.ignore = executor::NamePattern("topics_ignore_for_graph", ignore);
    } catch (const executor::Error& error) {
        why = error.what();
        return false;
    }
    return true;
}

// @return false and sets `why` if a remap or an expression is invalid
bool loadCall(const rtcf_msgs::LoadComponent::Request& request, OutsideCall& call,
              std::string& why) {
    call.kind = OutsideCall::Kind::Load;
    executor::ComponentDefinition& component = call.component;
    setName(component, request.name, request.ns);
    component.package = request.package;
    component.type = request.type;
    for (const std::string& remap : request.remaps) {
        const std::size_t at = remap.find(":=");
        if (at == std::string::npos) {
            why = "'" + remap + "' is not a remap: write it as from:=to";
            return false;
        }
        component.remaps.emplace_back(remap.substr(0, at), remap.substr(at + 2));
    }
    return setBreaks(component, request.is_first != 0, request.topics_ignore_for_graph, why);
}

// @return false and sets `why` if an expression is invalid
bool loadCall(const rtcf_msgs::LoadOrocosComponent::Request& request, OutsideCall& call,
              std::string& why) {
    call.kind = OutsideCall::Kind::Load;
    executor::ComponentDefinition& component = call.component;
    setName(component, request.component_name.data, request.ns.data);
    component.package = request.component_pkg.data;
    component.type = request.component_type.data;
    for (const rtcf_msgs::Mapping& remap : request.mappings)
        component.remaps.emplace_back(remap.from_topic.data, remap.to_topic.data);
    return setBreaks(component, request.is_first.data != 0, request.topics_ignore_for_graph.data,
                     why);
}

OutsideCall unloadCall(const std::string& name, std::string ns) {
    OutsideCall call;
    call.kind = OutsideCall::Kind::Unload;
    const bool absolute = !name.empty() && name.front() == '/';
    if (absolute || ns.empty()) ns = "/";
    if (ns.front() != '/') ns.insert(0, "/");
    if (ns.back() != '/') ns += '/';
    call.name = absolute ? name : ns + name;
    return call;
}

OutsideCall simpleCall(OutsideCall::Kind kind) {
    OutsideCall call;
    call.kind = kind;
    return call;
}

}  // namespace

RunnerServices::RunnerServices(const executor::RunnerView& runner, executor::AskSupervisor ask,
                               executor::Log& log)
    : runner_(runner), ask_(std::move(ask)), log_(log) {
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

// Logs the reason, because RTCF 2021's responses have no field for it.
void RunnerServices::changeAndLog(const OutsideCall& call, std_msgs::Bool& success) {
    const executor::OutsideAnswer answer = ask_(call, cancel_);
    success.data = answer.success ? 1 : 0;
    if (!answer.success) logFailure(answer.message);
}

void RunnerServices::logFailure(const std::string& why) {
    log_.write(LogLevel::Error, "", "service call failed: " + why);
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
    using std_srvs::Trigger;
    const auto at = [&](const char* name) { return executor::joinName(name_space, name); };
    openLikeRtcf2021(handle, name_space);
    using Get = rtcf_msgs::GetLoop;
    advertise<Get>(handle, at("get_loop"), looks_, [this](Get::Request&, Get::Response& response) {
        response = describeRunner(runner_);
        return true;
    });
    using Load = rtcf_msgs::LoadComponent;
    advertise<Load>(handle, at("load_component"), changes_,
                    [this](Load::Request& request, Load::Response& response) {
                        OutsideCall call;
                        response.success = 0;
                        if (!loadCall(request, call, response.message)) return true;
                        return change(call, response);
                    });
    using Unload = rtcf_msgs::UnloadComponent;
    advertise<Unload>(handle, at("unload_component"), changes_,
                      [this](Unload::Request& request, Unload::Response& response) {
                          return change(unloadCall(request.name, request.ns), response);
                      });
    advertise<Trigger>(handle, at("activate_rt_loop"), changes_,
                       [this](Trigger::Request&, Trigger::Response& response) {
                           return change(simpleCall(OutsideCall::Kind::Start), response);
                       });
    // In its own queue, so that a stop does not wait behind a slow change.
    advertise<Trigger>(handle, at("deactivate_rt_loop"), stops_,
                       [this](Trigger::Request&, Trigger::Response& response) {
                           return change(simpleCall(OutsideCall::Kind::Stop), response);
                       });
}

void RunnerServices::openLikeRtcf2021(ros::NodeHandle& handle, const std::string& name_space) {
    const auto at = [&](const char* name) { return executor::joinName(name_space, name); };
    using Get = rtcf_msgs::GetRunnerInfo;
    advertise<Get>(handle, at("get_introspection_information"), looks_,
                   [this](Get::Request&, Get::Response& response) {
                       response.runner_info = runnerInfo(describeRunner(runner_));
                       return true;
                   });
    using Load = rtcf_msgs::LoadOrocosComponent;
    advertise<Load>(handle, at("load_orocos_component"), changes_,
                    [this](Load::Request& request, Load::Response& response) {
                        OutsideCall call;
                        std::string why;
                        response.success.data = 0;
                        if (loadCall(request, call, why)) {
                            changeAndLog(call, response.success);
                        } else {
                            logFailure(why);
                        }
                        return true;
                    });
    using Unload = rtcf_msgs::UnloadOrocosComponent;
    advertise<Unload>(handle, at("unload_orocos_component"), changes_,
                      [this](Unload::Request& request, Unload::Response& response) {
                          changeAndLog(unloadCall(request.component_name.data, request.ns.data),
                                       response.success);
                          return true;
                      });
}

void RunnerServices::close() {
    // Cancels pending calls, because closing a server waits for them.
    cancel_ = true;
    for (ros::ServiceServer& server : servers_) server.shutdown();
    servers_.clear();
    cancel_ = false;
}

}  // namespace rtcf::ros1
