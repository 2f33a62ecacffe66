#include "ros/parameters/parameter_mirror.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include "common/utf8.hpp"
#include "graph/fitted_value.hpp"

namespace rtcf::ros1 {

namespace {

XmlRpc::XmlRpcValue toXmlRpc(const ParameterValue& value) {
    if (const auto* truth = std::get_if<bool>(&value)) return {*truth};
    // Integers of XML-RPC have 32 bits.
    if (const auto* integer = std::get_if<std::int64_t>(&value)) {
        const auto narrow = static_cast<int>(*integer);
        return narrow == *integer ? XmlRpc::XmlRpcValue(narrow)
                                  : XmlRpc::XmlRpcValue(static_cast<double>(*integer));
    }
    if (const auto* real = std::get_if<double>(&value)) return {*real};
    return {std::get<std::string>(value)};
}

// Returns the value of a parameter in the struct of its component; null if there is none. The
// values of a group are a struct in it.
XmlRpc::XmlRpcValue* find(XmlRpc::XmlRpcValue& values, const std::string& name) {
    XmlRpc::XmlRpcValue* found = &values;
    for (std::size_t begin = 0; begin != std::string::npos;) {
        const std::size_t end = name.find('/', begin);
        const std::string part = name.substr(begin, end - begin);
        if (found->getType() != XmlRpc::XmlRpcValue::TypeStruct || !found->hasMember(part))
            return nullptr;
        found = &(*found)[part];
        begin = end == std::string::npos ? end : end + 1;
    }
    return found;
}

// True for the size of a vector that the master has as a list: when the component was loaded, the
// list counted, and the launcher ignored the size.
bool listOverrides(XmlRpc::XmlRpcValue& values, const ParameterDeclaration& declaration) {
    if (!declaration.is_size) return false;
    XmlRpc::XmlRpcValue* const list = find(values, declaration.vectorName());
    return list != nullptr && list->getType() == XmlRpc::XmlRpcValue::TypeArray;
}

// Unset if no parameter can have this type, as a list. The loop checks the declared type.
std::optional<ParameterValue> plainValue(XmlRpc::XmlRpcValue& value) {
    switch (value.getType()) {
        case XmlRpc::XmlRpcValue::TypeBoolean:
            return static_cast<bool&>(value);
        case XmlRpc::XmlRpcValue::TypeInt:
            return std::int64_t{static_cast<int&>(value)};
        case XmlRpc::XmlRpcValue::TypeDouble:
            return static_cast<double&>(value);
        case XmlRpc::XmlRpcValue::TypeString:
            return static_cast<std::string&>(value);
        default:
            return std::nullopt;
    }
}

std::optional<ParameterValue> fromXmlRpc(XmlRpc::XmlRpcValue& value,
                                         const ParameterDeclaration& declaration) {
    std::optional<ParameterValue> found = plainValue(value);
    if (found) executor::fit(declaration, *found);
    return found;
}

// True if XML can carry the value: it cannot carry control characters and invalid UTF-8, and
// changes carriage returns.
bool canBeSent(const ParameterValue& value) {
    const auto* const text = std::get_if<std::string>(&value);
    if (text == nullptr) return true;
    const auto carried = [](char each) {
        const auto byte = static_cast<unsigned char>(each);
        return byte == '\t' || byte == '\n' || (byte >= 0x20U && byte != 0x7FU);
    };
    return executor::isUtf8(*text) && std::all_of(text->begin(), text->end(), carried);
}

constexpr std::size_t kMost = 400;  // most calls in one reconcile()

std::chrono::steady_clock::time_point soon() {
    return std::chrono::steady_clock::now() + kMasterAnswerTimeout;
}

}  // namespace

void ParameterMirror::noteWritten(const std::string& key) {
    const std::lock_guard lock(pending_->mutex);
    // The key is a component's namespace with a slash at its end, or below it. Any peer may send
    // any key, of any length, so the cost must not depend on its slashes.
    for (const std::string& component : pending_->followed) {
        if (key.size() > component.size() && key[component.size()] == '/' &&
            key.compare(0, component.size(), component) == 0)
            pending_->written.insert(component);
    }
}

std::string ParameterMirror::problem() const {
    const std::lock_guard lock(pending_->mutex);
    return pending_->problem;
}

void ParameterMirror::forget() {
    known_.clear();
    owed_.clear();
    const std::lock_guard lock(pending_->mutex);
    pending_->followed.clear();
    pending_->written.clear();
    pending_->refused.clear();
}

Reconciled ParameterMirror::reconcile(ParallelCalls& master, const Caller& caller,
                                      const std::vector<Component>& components) {
    std::vector<Component> present;
    std::vector<Component> refused;
    {
        const std::lock_guard lock(pending_->mutex);
        for (const Component& component : components) {
            const std::string& name = component.set->full_name;
            // While a request to the loop is pending, the value is undecided.
            if (pending_->asked.count(name) != 0 || owed_.count(name) != 0) continue;
            present.push_back(component);
            if (pending_->refused.count(name) != 0) refused.push_back(component);
        }
    }
    const Reconciled owing = owed_.empty() ? Reconciled::Done : Reconciled::Later;
    Reconciled result = Reconciled::Done;
    // Before the rejected value is read and requested again.
    if (!refused.empty()) {
        if (!write(master, caller, refused, result)) return result & owing;
        const std::lock_guard lock(pending_->mutex);
        for (const Component& component : refused) {
            pending_->refused.erase(component.set->full_name);
            known_[component.set->full_name].others.clear();
        }
    }
    std::set<std::string> asked;
    if (!read(master, caller, present, asked, result)) return result & owing;
    {
        const std::lock_guard lock(pending_->mutex);
        // Skips components with new requests: the loop may have answered, but these values are
        // older.
        const auto waits = [&](const Component& component) {
            const std::string& name = component.set->full_name;
            return asked.count(name) != 0 || pending_->followed.count(name) == 0;
        };
        present.erase(std::remove_if(present.begin(), present.end(), waits), present.end());
    }
    write(master, caller, present, result);
    return result & owing;
}

// @param asked receives the names of components with requests to the loop
// @return false if nothing more can be done now
bool ParameterMirror::read(ParallelCalls& master, const Caller& caller,
                           const std::vector<Component>& components, std::set<std::string>& asked,
                           Reconciled& result) {
    std::vector<const Component*> looked_at;
    std::vector<bool> first;
    std::vector<MasterCall> calls;
    {
        const std::lock_guard lock(pending_->mutex);
        for (const Component& component : components) {
            const std::string& name = component.set->full_name;
            const bool followed = pending_->followed.count(name) != 0;
            // Later writes are read again.
            if (followed && pending_->written.erase(name) == 0) continue;
            if (calls.size() == kMost) {
                if (followed) pending_->written.insert(name);
                result = result & Reconciled::Again;
                break;
            }
            looked_at.push_back(&component);
            first.push_back(!followed);
            calls.push_back(
                followed ? MasterCall{"getParam", texts({caller.name, name})}
                         : MasterCall{"subscribeParam", texts({caller.name, caller.uri, name})});
        }
    }
    std::vector<MasterAnswer> answers = master.run(calls, kMasterAnswerTimeout, soon());
    for (std::size_t i = 0; i < answers.size(); ++i) {
        const std::string& name = looked_at[i]->set->full_name;
        if (answers[i].silent()) {
            if (!first[i]) noteWritten(name + "/");
            result = Reconciled::Later;
            continue;
        }
        if (first[i]) {
            const std::lock_guard lock(pending_->mutex);
            pending_->followed.insert(name);
        }
        if (take(answers[i].value, *looked_at[i], first[i])) asked.insert(name);
    }
    return result != Reconciled::Later;
}

// Compares the master's values with those of the loop, and requests changes.
// @param values the master's values of the component's namespace; a struct if there are any
// @param first  true = for the first time at this master
// @return true if the loop is asked to change values
bool ParameterMirror::take(XmlRpc::XmlRpcValue& values, const Component& component, bool first) {
    const executor::ParameterSet& set = *component.set;
    Known& known = known_[set.full_name];
    executor::ParameterBatch batch;
    for (const auto& [declaration, value, given] : set.parameters) {
        const std::string& name = declaration.name;
        XmlRpc::XmlRpcValue* const theirs = find(values, name);
        std::optional<ParameterValue> found;
        if (theirs != nullptr) found = fromXmlRpc(*theirs, declaration);
        if (!found) {
            if (theirs != nullptr && follows_)
                rejections_.push_back("the value of " + set.full_name + "/" + name +
                                      " on the parameter server is a list or a mapping: rejected, "
                                      "parameter " +
                                      name + " takes one " + declaration.type);
            known.values.erase(name);
            known.others.erase(name);
            continue;
        }
        const auto before = known.values.find(name);
        if (before == known.values.end() || !sameValue(before->second, *found)) {
            known.others[name] = *theirs;
            known.ours.erase(name);
        }
        known.values[name] = *found;
        const bool was_given =
            first && component.is_new && (given || !sameValue(value, declaration.default_value));
        const bool keeps = was_given || (first && listOverrides(values, declaration));
        if (!sameValue(*found, value) && !keeps) batch.emplace_back(name, *std::move(found));
    }
    if (batch.empty() || !follows_) return false;
    ask(set.full_name, std::move(batch));
    return true;
}

void ParameterMirror::ask(const std::string& component, executor::ParameterBatch batch) {
    {
        const std::lock_guard lock(pending_->mutex);
        pending_->asked.insert(component);
    }
    request_(component, std::move(batch), executor::BatchPolicy::Each,
             [pending = pending_, name = component](const std::string& error) {
                 const std::lock_guard lock(pending->mutex);
                 pending->asked.erase(name);
                 if (!error.empty()) pending->refused.insert(name);
             });
}

// Writes values of the loop to the master.
// @return false if nothing more can be done now
bool ParameterMirror::write(ParallelCalls& master, const Caller& caller,
                            const std::vector<Component>& components, Reconciled& result) {
    struct Written {
        Known* known;
        const executor::ParameterView* parameter;
    };
    std::vector<Written> writing;
    std::string problem;
    std::vector<MasterCall> calls;
    for (const Component& component : components) {
        Known& known = known_[component.set->full_name];
        for (const executor::ParameterView& parameter : component.set->parameters) {
            const std::string& name = parameter.declaration.name;
            const std::string full = component.set->full_name + "/" + name;
            if (!canBeSent(parameter.value)) {
                problem = "cannot store the value of " + full +
                          " on the parameter server: it contains characters that XML-RPC cannot "
                          "carry";
                continue;
            }
            const auto found = known.values.find(name);
            if (found != known.values.end() && sameValue(found->second, parameter.value)) continue;
            if (calls.size() == kMost) {
                result = result & Reconciled::Again;
                break;
            }
            XmlRpc::XmlRpcValue arguments = texts({caller.name, full});
            arguments[2] = toXmlRpc(parameter.value);
            calls.push_back({"setParam", arguments});
            writing.push_back({&known, &parameter});
            known.ours.insert(name);  // even if there is no answer
        }
    }
    {
        const std::lock_guard lock(pending_->mutex);
        pending_->problem = problem;
    }
    const std::vector<MasterAnswer> answers = master.run(calls, kMasterAnswerTimeout, soon());
    for (std::size_t i = 0; i < answers.size(); ++i) {
        if (answers[i].silent()) {
            result = Reconciled::Later;
            continue;
        }
        // A rejected call is not repeated either.
        const std::string& name = writing[i].parameter->declaration.name;
        writing[i].known->values[name] = writing[i].parameter->value;
    }
    return result == Reconciled::Done;
}

void ParameterMirror::leave(ParallelCalls& master, const Caller& caller,
                            const std::set<std::string>& components,
                            std::chrono::steady_clock::time_point deadline) {
    for (const std::string& component : components) {
        std::vector<MasterCall>& calls = owed_[component];
        {
            const std::lock_guard lock(pending_->mutex);
            pending_->written.erase(component);
            pending_->refused.erase(component);
            if (pending_->followed.erase(component) != 0) {
                calls.push_back({"unsubscribeParam", texts({caller.name, caller.uri, component})});
            }
        }
        const auto known = known_.find(component);
        if (known == known_.end()) continue;
        for (const std::string& name : known->second.ours) {
            XmlRpc::XmlRpcValue arguments = texts({caller.name, component + "/" + name});
            const auto other = known->second.others.find(name);
            if (other != known->second.others.end()) arguments[2] = other->second;
            const bool delete_it = other == known->second.others.end();
            calls.push_back({delete_it ? "deleteParam" : "setParam", arguments});
        }
        known_.erase(known);
    }
    std::vector<std::string> of;
    std::vector<MasterCall> calls;
    for (auto& [component, owed] : std::exchange(owed_, {})) {
        of.insert(of.end(), owed.size(), component);
        calls.insert(calls.end(), owed.begin(), owed.end());
    }
    const std::vector<MasterAnswer> answers = master.run(calls, kMasterAnswerTimeout, deadline);
    for (std::size_t i = 0; i < answers.size(); ++i) {
        if (answers[i].silent()) owed_[of[i]].push_back(std::move(calls[i]));
    }
}

void ParameterMirror::leaveAll(ParallelCalls& master, const Caller& caller,
                               std::chrono::steady_clock::time_point deadline) {
    std::set<std::string> all;
    for (const auto& [component, known] : known_) all.insert(component);
    leave(master, caller, all, deadline);
}

}  // namespace rtcf::ros1
