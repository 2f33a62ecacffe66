#include "ros/reconfigure/reconfiguring.hpp"

#include <ros/node_handle.h>

#include <algorithm>
#include <chrono>

#include "ros/reconfigure/reconfigure_server.hpp"
#include "ros/threads/quiet_thread.hpp"

namespace rtcf::ros1 {

namespace {

// Timeout of the removal of components.
constexpr auto kLeaveTimeout = std::chrono::milliseconds(1000);

bool sameChoices(const std::vector<Choice>& one, const std::vector<Choice>& other) {
    return std::equal(
        one.begin(), one.end(), other.begin(), other.end(),
        [](const Choice& a, const Choice& b) { return a.name == b.name && a.value == b.value; });
}

}  // namespace

Reconfiguring::Reconfiguring(
    std::function<void(const std::string& component, const std::string& line)> warn) {
    range_.warn = std::move(warn);
    thread_ = quietThread("ros-parameters", [this] { run(); });
}

Reconfiguring::~Reconfiguring() {
    stop_ = true;
    queue_.disable();  // wakes the thread up
    thread_.join();
}

void Reconfiguring::setSets(const Sets& sets) {
    const std::lock_guard lock(mutex_);
    Servers wanted;
    for (const auto& set : sets) {
        const auto found = wanted_.find(set->full_name);
        // True for the same component with other values; false for another one of that name.
        const auto declares_same = [&](const executor::ParameterSet& known) {
            if (known.parameters.size() != set->parameters.size()) return false;
            for (std::size_t i = 0; i < known.parameters.size(); ++i) {
                const ParameterDeclaration& one = known.parameters[i].declaration;
                const ParameterDeclaration& other = set->parameters[i].declaration;
                if (one.name != other.name || one.type != other.type ||
                    one.minimum != other.minimum || one.maximum != other.maximum ||
                    !sameValue(one.default_value, other.default_value) || one.doc != other.doc ||
                    one.unit != other.unit || !sameChoices(one.choices, other.choices))
                    return false;
            }
            return true;
        };
        if (found != wanted_.end() && declares_same(*found->second->set())) {
            found->second->update(set);
            wanted.insert(*found);
        } else {
            wanted[set->full_name] =
                std::make_shared<ReconfigureServer>(set, request_, range_, stop_);
            if (met_) new_.insert(set->full_name);
        }
    }
    wanted_ = std::move(wanted);
}

Reconciled Reconfiguring::reconcile(ros::NodeHandle& handle, ParallelCalls& master,
                                    const ParameterMirror::Caller& caller) {
    Servers wanted;
    Servers closing;
    std::vector<ParameterMirror::Component> components;
    {
        const std::lock_guard lock(mutex_);
        wanted = wanted_;
        for (auto server = servers_.begin(); server != servers_.end();) {
            const auto found = wanted.find(server->first);
            if (found != wanted.end() && found->second == server->second) {
                ++server;
                continue;
            }
            closing.insert(*server);
            server = servers_.erase(server);
        }
        met_ = true;
        for (const auto& [component, server] : wanted)
            components.push_back({server->set(), new_.count(component) != 0});
    }
    std::set<std::string> left;
    for (const auto& [component, server] : closing) {
        server->close();
        left.insert(component);
    }
    mirror_.leave(master, caller, left, std::chrono::steady_clock::now() + kLeaveTimeout);
    Reconciled result = Reconciled::Done;
    for (const auto& [component, server] : wanted) {
        if (!server->isDue()) continue;
        server->open(handle, queue_);
        if (!server->isOpen()) result = Reconciled::Later;
        const std::lock_guard lock(mutex_);
        servers_[component] = server;
    }
    return result & mirror_.reconcile(master, caller, components);
}

void Reconfiguring::allow(bool allowed) {
    range_.allowed = allowed;
    mirror_.follow(allowed);
}

void Reconfiguring::forget() {
    unmeet();
    mirror_.forget();
}

void Reconfiguring::unmeet() {
    const std::lock_guard lock(mutex_);
    met_ = false;
    new_.clear();
}

void Reconfiguring::closeAll(ParallelCalls& master, const ParameterMirror::Caller& caller,
                             std::chrono::steady_clock::time_point deadline) {
    Servers closing;
    {
        const std::lock_guard lock(mutex_);
        closing.swap(servers_);
    }
    for (const auto& [component, server] : closing) server->close();
    mirror_.leaveAll(master, caller, deadline);
    unmeet();
}

std::string Reconfiguring::problem() const {
    {
        const std::lock_guard lock(mutex_);
        for (const auto& [component, server] : servers_) {
            if (!server->problem().empty()) return server->problem();
        }
    }
    return mirror_.problem();
}

void Reconfiguring::run() {
    while (!stop_) queue_.callAvailable(ros::WallDuration(0.1));
}

}  // namespace rtcf::ros1
