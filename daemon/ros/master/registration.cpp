#include "ros/master/registration.hpp"

#include <vector>

namespace rtcf::ros1 {

namespace {

XmlRpc::XmlRpcValue array(const std::vector<std::string>& texts) {
    XmlRpc::XmlRpcValue value;
    value.setSize(static_cast<int>(texts.size()));
    for (std::size_t i = 0; i < texts.size(); ++i) value[static_cast<int>(i)] = texts[i];
    return value;
}

struct Topic {
    std::string name;
    std::string type;
};

// The node's own account of its topics, which includes those that components opened.
bool topics(MasterClient& self, const char* method, std::vector<Topic>& found) {
    MasterAnswer answer = self.call(method, array({"/rtcfd"}));
    if (!answer || answer.value.getType() != XmlRpc::XmlRpcValue::TypeArray) return false;
    // NOLINTNEXTLINE(modernize-loop-convert): its begin() is for structs
    for (int i = 0; i < answer.value.size(); ++i) {
        XmlRpc::XmlRpcValue& pair = answer.value[i];
        found.push_back({static_cast<std::string&>(pair[0]), static_cast<std::string&>(pair[1])});
    }
    return true;
}

}  // namespace

Lookup lookUp(MasterClient& master, const RoscppNode& node) {
    MasterAnswer answer =
        master.call("lookupNode", array({node.name().full(), node.name().full()}));
    if (answer.silent()) return {Lookup::Kind::Silent, {}};
    if (!answer) return {Lookup::Kind::Unknown, {}};
    const std::string uri = answer.text();
    return {uri == node.uri() ? Lookup::Kind::Ours : Lookup::Kind::Other, uri};
}

bool registerAll(MasterClient& master, MasterClient& self, const RoscppNode& node) {
    const std::string caller = node.name().full();
    const std::string uri = node.uri();
    std::vector<Topic> publications;
    std::vector<Topic> subscriptions;
    if (!topics(self, "getPublications", publications)) return false;
    if (!topics(self, "getSubscriptions", subscriptions)) return false;
    for (const Topic& topic : publications) {
        if (!master.call("registerPublisher", array({caller, topic.name, topic.type, uri})))
            return false;
    }
    for (const auto& [service, service_uri] : node.calls().services()) {
        if (!master.call("registerService", array({caller, service, service_uri, uri})))
            return false;
    }
    for (const Topic& topic : subscriptions) {
        MasterAnswer publishers =
            master.call("registerSubscriber", array({caller, topic.name, topic.type, uri}));
        if (!publishers) return false;
        XmlRpc::XmlRpcValue update = array({"/master", topic.name, ""});
        update[2] = publishers.value;
        if (!self.call("publisherUpdate", update)) return false;
    }
    return true;
}

bool withdrawAll(MasterClient& master, MasterClient& self, const RoscppNode& node,
                 std::chrono::steady_clock::time_point deadline) {
    const std::string caller = node.name().full();
    const auto withdraw = [&](const char* method, const std::string& name, const std::string& uri) {
        return std::chrono::steady_clock::now() < deadline &&
               !master.call(method, array({caller, name, uri})).silent();
    };
    std::vector<Topic> publications;
    std::vector<Topic> subscriptions;
    if (!topics(self, "getPublications", publications)) return false;
    if (!topics(self, "getSubscriptions", subscriptions)) return false;
    for (const Topic& topic : publications) {
        if (!withdraw("unregisterPublisher", topic.name, node.uri())) return false;
    }
    for (const Topic& topic : subscriptions) {
        if (!withdraw("unregisterSubscriber", topic.name, node.uri())) return false;
    }
    for (const auto& [service, service_uri] : node.calls().services()) {
        if (!withdraw("unregisterService", service, service_uri)) return false;
    }
    return true;
}

}  // namespace rtcf::ros1
