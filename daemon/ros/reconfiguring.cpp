#include "ros/reconfiguring.hpp"

#include <ros/node_handle.h>

#include <chrono>

#include "ros/parameter_server.hpp"
#include "ros/quiet_thread.hpp"

namespace rtcf::ros1 {

namespace {

// For one call: the watch has more to look at than a thousand components' parameters.
constexpr auto kTurn = std::chrono::milliseconds(300);

XmlRpc::XmlRpcValue toXmlRpc(const ParameterValue& value) {
    if (const auto* truth = std::get_if<bool>(&value)) return {*truth};
    // XML-RPC has 32 bits.
    if (const auto* integer = std::get_if<std::int64_t>(&value)) {
        const auto narrow = static_cast<int>(*integer);
        return narrow == *integer ? XmlRpc::XmlRpcValue(narrow)
                                  : XmlRpc::XmlRpcValue(static_cast<double>(*integer));
    }
    if (const auto* real = std::get_if<double>(&value)) return {*real};
    return {std::get<std::string>(value)};
}

}  // namespace

Reconfiguring::Reconfiguring() {
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
        // The same component with other values, or another one of that name.
        const auto declares_same = [&](const executor::ParameterSet& known) {
            if (known.parameters.size() != set->parameters.size()) return false;
            for (std::size_t i = 0; i < known.parameters.size(); ++i) {
                const ParameterDeclaration& one = known.parameters[i].declaration;
                const ParameterDeclaration& other = set->parameters[i].declaration;
                if (one.name != other.name || one.type != other.type ||
                    one.minimum != other.minimum || one.maximum != other.maximum ||
                    one.default_value != other.default_value || one.doc != other.doc)
                    return false;
            }
            return true;
        };
        if (found != wanted_.end() && declares_same(*found->second->set())) {
            found->second->update(set);
            wanted.insert(*found);
        } else {
            wanted[set->full_name] = std::make_shared<ParameterServer>(set, request_, stop_);
        }
    }
    wanted_ = std::move(wanted);
}

bool Reconfiguring::reconcile(ros::NodeHandle& handle, MasterClient& master,
                              const std::string& caller) {
    Servers wanted;
    Servers closing;
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
    }
    for (const auto& [component, server] : closing) {
        server->close();
        const std::string prefix = component + "/";
        auto key = uploaded_.lower_bound(prefix);
        while (key != uploaded_.end() && key->first.rfind(prefix, 0) == 0)
            key = uploaded_.erase(key);
    }
    const auto until = std::chrono::steady_clock::now() + kTurn;
    for (const auto& [component, server] : wanted) {
        if (std::chrono::steady_clock::now() > until) return false;
        if (!server->isOpen() && server->problem().empty()) {
            server->open(handle, queue_);
            const std::lock_guard lock(mutex_);
            servers_[component] = server;
        }
        if (!upload(master, caller, *server->set())) return false;
    }
    return true;
}

bool Reconfiguring::upload(MasterClient& master, const std::string& caller,
                           const executor::ParameterSet& set) {
    for (const auto& [declaration, value] : set.parameters) {
        const std::string key = set.full_name + "/" + declaration.name;
        const auto found = uploaded_.find(key);
        if (found != uploaded_.end() && found->second == value) continue;
        XmlRpc::XmlRpcValue arguments;
        arguments[0] = caller;
        arguments[1] = key;
        arguments[2] = toXmlRpc(value);
        if (master.call("setParam", arguments).silent()) return false;
        uploaded_[key] = value;
    }
    return true;
}

void Reconfiguring::closeAll() {
    Servers closing;
    {
        const std::lock_guard lock(mutex_);
        closing.swap(servers_);
    }
    for (const auto& [component, server] : closing) server->close();
    uploaded_.clear();
}

std::string Reconfiguring::problem() const {
    const std::lock_guard lock(mutex_);
    for (const auto& [component, server] : servers_) {
        if (!server->problem().empty()) return server->problem();
    }
    return {};
}

void Reconfiguring::run() {
    while (!stop_) queue_.callAvailable(ros::WallDuration(0.1));
}

}  // namespace rtcf::ros1
