#include "ros/parameters/parameter_mirror.hpp"

#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

namespace rtcf::ros1 {

namespace {

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

// Whether it is of the declared type, the loop knows and says. Nothing for what no parameter is.
std::optional<ParameterValue> fromXmlRpc(XmlRpc::XmlRpcValue& value, const std::string& type) {
    switch (value.getType()) {
        case XmlRpc::XmlRpcValue::TypeBoolean:
            return static_cast<bool&>(value);
        case XmlRpc::XmlRpcValue::TypeInt: {
            const int integer = static_cast<int&>(value);
            if (type == "double") return static_cast<double>(integer);
            return std::int64_t{integer};
        }
        case XmlRpc::XmlRpcValue::TypeDouble: {
            constexpr double kExact = 9007199254740992.0;  // integers up to there
            const double real = static_cast<double&>(value);
            const bool whole = std::abs(real) <= kExact && std::trunc(real) == real;
            if (type == "int" && whole) return static_cast<std::int64_t>(real);
            return real;
        }
        case XmlRpc::XmlRpcValue::TypeString:
            return static_cast<std::string&>(value);
        default:
            return std::nullopt;
    }
}

XmlRpc::XmlRpcValue arguments(const std::string& first, const std::string& second) {
    XmlRpc::XmlRpcValue array;
    array[0] = first;
    array[1] = second;
    return array;
}

}  // namespace

void ParameterMirror::noteWritten(const std::string& key) {
    const std::lock_guard lock(pending_->mutex);
    // It is the component's own, with a slash at its end, or one below it.
    for (std::size_t end = key.find('/', 1); end != std::string::npos;
         end = key.find('/', end + 1)) {
        const std::string component = key.substr(0, end);
        if (pending_->followed.count(component) != 0) pending_->written.insert(component);
    }
}

void ParameterMirror::forget() {
    known_.clear();
    const std::lock_guard lock(pending_->mutex);
    pending_->followed.clear();
    pending_->written.clear();
    pending_->refused.clear();
}

bool ParameterMirror::reconcile(MasterClient& master, const Caller& caller,
                                const executor::ParameterSet& set) {
    const std::string& component = set.full_name;
    Values& known = known_[component];
    bool written = false;
    bool followed = false;
    bool refused = false;
    {
        const std::lock_guard lock(pending_->mutex);
        // While the loop is asked, nobody knows which value is to hold.
        if (pending_->asked.count(component) != 0) return true;
        followed = pending_->followed.count(component) != 0;
        written = pending_->written.count(component) != 0;
        refused = pending_->refused.count(component) != 0;
    }
    if (refused) {
        // Before it is read again, and asked for again.
        if (!write(master, caller, set, known)) return false;
        const std::lock_guard lock(pending_->mutex);
        pending_->refused.erase(component);
    }
    if (written) {
        if (!read(master, caller, set, known)) return false;
        const std::lock_guard lock(pending_->mutex);
        if (pending_->asked.count(component) != 0) return true;
    }
    if (!write(master, caller, set, known)) return false;
    return followed || follow(master, caller, set, known);
}

bool ParameterMirror::write(MasterClient& master, const Caller& caller,
                            const executor::ParameterSet& set, Values& known) const {
    for (const auto& [declaration, value] : set.parameters) {
        const auto found = known.find(declaration.name);
        if (found != known.end() && found->second == value) continue;
        XmlRpc::XmlRpcValue call = arguments(caller.name, set.full_name + "/" + declaration.name);
        call[2] = toXmlRpc(value);
        if (master.call("setParam", call).silent()) return false;
        known[declaration.name] = value;
    }
    return true;
}

bool ParameterMirror::follow(MasterClient& master, const Caller& caller,
                             const executor::ParameterSet& set, Values& known) {
    XmlRpc::XmlRpcValue call = arguments(caller.name, caller.uri);
    call[2] = set.full_name;
    MasterAnswer answer = master.call("subscribeParam", call);
    if (answer.silent()) return false;
    {
        const std::lock_guard lock(pending_->mutex);
        pending_->followed.insert(set.full_name);
    }
    if (answer) take(answer.value, set, known);
    return true;
}

bool ParameterMirror::read(MasterClient& master, const Caller& caller,
                           const executor::ParameterSet& set, Values& known) {
    {
        // What is written from now on is looked at again.
        const std::lock_guard lock(pending_->mutex);
        pending_->written.erase(set.full_name);
    }
    MasterAnswer answer = master.call("getParam", arguments(caller.name, set.full_name));
    if (answer.silent()) {
        noteWritten(set.full_name + "/");
        return false;
    }
    take(answer.value, set, known);
    return true;
}

// @param values the master's of the component's namespace, a struct if there are any
void ParameterMirror::take(XmlRpc::XmlRpcValue& values, const executor::ParameterSet& set,
                           Values& known) {
    const bool any = values.getType() == XmlRpc::XmlRpcValue::TypeStruct;
    executor::ParameterBatch batch;
    for (const auto& [declaration, value] : set.parameters) {
        std::optional<ParameterValue> found;
        if (any && values.hasMember(declaration.name))
            found = fromXmlRpc(values[declaration.name], declaration.type);
        if (!found) {
            known.erase(declaration.name);
            continue;
        }
        if (*found != value) batch.emplace_back(declaration.name, *found);
        known[declaration.name] = *std::move(found);
    }
    if (batch.empty()) return;
    {
        const std::lock_guard lock(pending_->mutex);
        pending_->asked.insert(set.full_name);
    }
    request_(set.full_name, std::move(batch),
             [pending = pending_, name = set.full_name](const std::string& refusal) {
                 const std::lock_guard lock(pending->mutex);
                 pending->asked.erase(name);
                 if (!refusal.empty()) pending->refused.insert(name);
             });
}

bool ParameterMirror::leave(MasterClient& master, const Caller& caller,
                            const std::string& component) {
    known_.erase(component);
    {
        const std::lock_guard lock(pending_->mutex);
        pending_->written.erase(component);
        pending_->refused.erase(component);
        if (pending_->followed.erase(component) == 0) return true;
    }
    XmlRpc::XmlRpcValue call = arguments(caller.name, caller.uri);
    call[2] = component;
    return !master.call("unsubscribeParam", call).silent();
}

void ParameterMirror::leaveAll(MasterClient& master, const Caller& caller) {
    while (!known_.empty()) {
        const std::string component = known_.begin()->first;
        if (!leave(master, caller, component)) forget();
    }
}

}  // namespace rtcf::ros1
