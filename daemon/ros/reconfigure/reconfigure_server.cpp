#include "ros/reconfigure/reconfigure_server.hpp"

#include <ros/node_handle.h>

#include <chrono>
#include <future>
#include <utility>

#include "ros/reconfigure/reconfigure_messages.hpp"

namespace rtcf::ros1 {

namespace {

constexpr auto kPatience = std::chrono::seconds(10);  // longest time of a hook
constexpr auto kSlice = std::chrono::milliseconds(20);

}  // namespace

ReconfigureServer::ReconfigureServer(Set set, executor::ParameterRequest request,
                                     const RangePolicy& range, const std::atomic<bool>& ending)
    : request_(std::move(request)), range_(range), ending_(ending), set_(std::move(set)) {}

void ReconfigureServer::open(ros::NodeHandle& handle, ros::CallbackQueueInterface& queue) {
    using dynamic_reconfigure::ReconfigureRequest;
    using dynamic_reconfigure::ReconfigureResponse;
    const Set opening = set();
    const std::string& name = opening->full_name;
    const boost::function<bool(ReconfigureRequest&, ReconfigureResponse&)> change =
        [this](ReconfigureRequest& asked, ReconfigureResponse& answer) {
            return this->change(asked, answer);
        };
    ros::AdvertiseServiceOptions options;
    options.init<ReconfigureRequest, ReconfigureResponse>(name + "/set_parameters", change);
    options.callback_queue = &queue;
    ros::Publisher descriptions;
    ros::Publisher updates;
    ros::ServiceServer service;
    std::string problem;
    try {
        descriptions = handle.advertise<dynamic_reconfigure::ConfigDescription>(
            name + "/parameter_descriptions", 1, true);
        updates =
            handle.advertise<dynamic_reconfigure::Config>(name + "/parameter_updates", 1, true);
        service = handle.advertiseService(options);
        if (!descriptions || !updates || !service)
            problem = "this process already uses one of its names";
    } catch (const std::exception& error) {
        problem = error.what();
    }
    if (!problem.empty()) problem = "cannot offer dynamic_reconfigure for " + name + ": " + problem;
    if (descriptions) descriptions.publish(descriptionOf(*opening));
    const std::lock_guard lock(mutex_);
    descriptions_ = descriptions;
    updates_ = updates;
    service_ = service;
    problem_ = problem;
    retry_.note(problem.empty());
    if (updates_) updates_.publish(valuesOf(*set_));
}

void ReconfigureServer::close() {
    shutDown(mutex_, service_);
    shutDown(mutex_, updates_);
    shutDown(mutex_, descriptions_);
}

bool ReconfigureServer::isOpen() const {
    const std::lock_guard lock(mutex_);
    return service_ != nullptr;
}

bool ReconfigureServer::isDue() const { return !isOpen() && retry_.due(); }

std::string ReconfigureServer::problem() const {
    const std::lock_guard lock(mutex_);
    return problem_;
}

void ReconfigureServer::update(Set set) {
    const std::lock_guard lock(mutex_);
    if (set == set_) return;
    set_ = std::move(set);
    if (updates_) updates_.publish(valuesOf(*set_));
}

ReconfigureServer::Set ReconfigureServer::set() const {
    const std::lock_guard lock(mutex_);
    return set_;
}

// The answer contains the resulting values: the requested ones, or the previous ones if the change
// was rejected. With refuse_out_of_range, a rejected call fails instead.
bool ReconfigureServer::change(const dynamic_reconfigure::ReconfigureRequest& asked,
                               dynamic_reconfigure::ReconfigureResponse& answer) {
    const Set before = set();
    executor::ParameterBatch batch = batchOf(asked.config, *before);
    if (!range_.allowed) {  // the answer contains the present values
        range_.warn(
            before->full_name,
            "parameters are unchanged: ROS peers do not have the right 'tune'; to allow it: "
            "rtcfctl runner set --ros-peers tune");
        answer.config = valuesOf(*before);
        return true;
    }
    const bool refuse = range_.refuse;
    if (!refuse) {
        for (const std::string& line : bringWithinBounds(batch, *before))
            range_.warn(before->full_name, line);
    }
    bool refused = false;
    if (!batch.empty()) {
        const auto done = std::make_shared<std::promise<bool>>();
        std::future<bool> outcome = done->get_future();
        request_(before->full_name, std::move(batch), executor::BatchPolicy::Whole,
                 [done](const std::string& error) { done->set_value(!error.empty()); });
        const auto deadline = std::chrono::steady_clock::now() + kPatience;
        while (outcome.wait_for(kSlice) != std::future_status::ready) {
            // A hook hangs: the result is unknown.
            if (ending_ || std::chrono::steady_clock::now() > deadline) return false;
        }
        refused = outcome.get();
    }
    const std::lock_guard lock(mutex_);
    answer.config = valuesOf(*set_);
    // Corrects the display of other clients.
    if (refused && updates_) updates_.publish(answer.config);
    return !(refused && refuse);
}

}  // namespace rtcf::ros1
