/// @file
/// The executor's access to a component: its context, time, ports and declarations. For the
/// executor, test benches and the constructors of a component's members; not for components.
/// Included by component.hpp.
#pragma once

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "rtcf/member_owners.hpp"

namespace rtcf {

/// @tparam C Component or const Component
template <typename C>
class ComponentAccess {
   public:
    explicit ComponentAccess(C& component) noexcept RTCF_NONBLOCKING : component_(component) {}

    /// Sets the context. Before configure(); not real-time.
    void attach(ComponentContext& context) const noexcept { component_.context_ = &context; }
    ComponentContext& context() const noexcept RTCF_NONBLOCKING { return *component_.context_; }
    /// Sets the loop time of the next hook, > 0, the stamp of its writes. Real-time safe.
    void setTime(std::int64_t time_ns) const noexcept RTCF_NONBLOCKING {
        component_.now_ = time_ns;
    }
    /// The loop time, which stamps the component's writes.
    const Shared<std::int64_t>& now() const noexcept { return component_.now_; }
    /// The error text of the hook that failed.
    const std::string& failure() const noexcept { return rest().failure; }
    /// Before a hook, so that failure() is not that of an earlier one.
    void clearFailure() const noexcept { rest().failure.clear(); }

    /// @name Members, in the order of their declarations
    /// @{
    const std::vector<InputPort*>& inputs() const noexcept { return rest().inputs; }
    const std::vector<OutputPort*>& outputs() const noexcept { return rest().outputs; }
    const std::vector<ParameterBase*>& parameters() const noexcept { return rest().parameters; }
    const std::vector<DerivedBase*>& derived() const noexcept { return rest().derived; }
    const std::vector<MailboxBase*>& mailboxes() const noexcept { return rest().mailboxes; }
    const std::vector<StateDeclaration>& states() const noexcept { return rest().states; }
    /// Outputs whose values become visible to readers only when the executor commits them.
    const std::vector<OutputPort*>& stagedOutputs() const noexcept { return rest().staged_outputs; }
    /// Stages the outputs for which `which(const OutputPort&)` is true. Before they have readers;
    /// not real-time.
    template <typename Which>
    void stageOutputs(const Which& which) const {
        rest().staged_outputs.clear();
        for (OutputPort* output : rest().outputs) {
            if (which(*output)) output->stage();
            if (output->staged()) rest().staged_outputs.push_back(output);
        }
    }
    /// @}

    /// @name Declarations of members
    /// Not real-time.
    /// @throws std::logic_error if the name is taken or not legal, and after freeze()
    /// @{
    void declare(std::unique_ptr<InputPort> input) const {
        declarePort(rest().inputs, input.get());
        own(addressOf(input));
        rest().input_ports.push_back(std::move(input));
    }
    void declare(OutputPort* output) const {
        declarePort(rest().outputs, output);
        own(addressOf(output));
        if (output->staged()) rest().staged_outputs.push_back(output);
    }
    void declare(DerivedBase* derived) const {
        rest().derived.push_back(derived);
        own(derived);
    }
    void declare(MailboxBase* mailbox) const {
        rest().mailboxes.push_back(mailbox);
        own(mailbox);
    }
    void declare(StateDeclaration state) const;
    void declare(ParameterBase* parameter) const;
    /// Rejects further parameters, which are set before configure(). After the constructor.
    void freezeParameters() const noexcept { rest().parameters_frozen = true; }
    /// Rejects further declarations. After configure().
    void freeze() const noexcept { rest().frozen = true; }
    /// @}

    /// @name Members that end before the component
    /// Not real-time.
    /// @{
    /// Those that ended before freeze(), as "parameter 'gain'": an error of the component.
    const std::vector<std::string>& ended() const noexcept { return rest().ended; }
    /// Removes a member from the lists above. @param member its address
    void end(const void* member) const;
    /// Before the end of the component.
    void forgetMembers() const noexcept {
        visitMembers([](const void* member) { detail::memberOwners().take(member); });
    }
    /// @}

   private:
    Component::Rest& rest() const noexcept { return *component_.rest_; }
    // Members are known by these addresses.
    static const void* addressOf(const InputPort* port) noexcept { return &port->input(); }
    static const void* addressOf(const std::unique_ptr<InputPort>& port) noexcept {
        return &port->input();
    }
    static const void* addressOf(const OutputPort* port) noexcept { return &port->output(); }
    static const void* addressOf(const StateDeclaration& state) noexcept { return state.value; }
    static const void* addressOf(const void* member) noexcept { return member; }
    void own(const void* member) const { detail::memberOwners().add(member, &component_); }
    template <typename Visit>
    void visitMembers(const Visit& visit) const {
        const Component::Rest& of = rest();
        for (const InputPort* each : of.inputs) visit(addressOf(each));
        for (const OutputPort* each : of.outputs) visit(addressOf(each));
        for (const ParameterBase* each : of.parameters) visit(each);
        for (const DerivedBase* each : of.derived) visit(each);
        for (const MailboxBase* each : of.mailboxes) visit(each);
        for (const StateDeclaration& each : of.states) visit(each.value);
    }
    template <typename T>
    void declarePort(std::vector<T*>& members, T* port) const;
    void requireDeclarable(const std::string& name, const char* what, bool in_group = false) const;

    C& component_;
};

/// @name Access to a component
/// Real-time safe.
/// @{
inline ComponentAccess<Component> accessTo(Component& component) noexcept RTCF_NONBLOCKING {
    return ComponentAccess<Component>(component);
}
inline ComponentAccess<const Component> accessTo(const Component& component) noexcept
    RTCF_NONBLOCKING {
    return ComponentAccess<const Component>(component);
}
/// @}

// @param in_group true = the name may be a path of groups, as gains/p
template <typename C>
void ComponentAccess<C>::requireDeclarable(const std::string& name, const char* what,
                                           bool in_group) const {
    bool legal = true;
    bool begins = true;  // a base name
    for (const char c : name) {
        const auto byte = static_cast<unsigned char>(c);
        if (in_group && c == '/' && !begins) {
            begins = true;
            continue;
        }
        legal = legal &&
                (std::isalpha(byte) != 0 || (!begins && (std::isdigit(byte) != 0 || c == '_')));
        begins = false;
    }
    if (!legal || begins) {
        throw std::logic_error(
            fmt::format("{} '{}': not a legal name (a letter, then letters, digits and _{})", what,
                        name, in_group ? "; / between groups" : ""));
    }
    if (rest().frozen)
        throw std::logic_error(fmt::format("{} '{}' declared after configure()", what, name));
}

template <typename C>
void ComponentAccess<C>::declare(ParameterBase* parameter) const {
    const std::string& name = parameter->declaration().name;
    requireDeclarable(name, "parameter", true);
    if (rest().parameters_frozen) {
        throw std::logic_error(fmt::format(
            "parameter '{}' declared after the constructor: make it a member of the class", name));
    }
    const auto contains = [](const std::string& group, const std::string& member) {
        return member.size() > group.size() && member[group.size()] == '/' &&
               member.compare(0, group.size(), group) == 0;
    };
    for (const ParameterBase* other : rest().parameters) {
        const std::string& taken = other->declaration().name;
        if (taken == name)
            throw std::logic_error(fmt::format("parameter '{}' is declared twice", name));
        if (contains(taken, name) || contains(name, taken)) {
            const std::string& both = taken.size() < name.size() ? taken : name;
            throw std::logic_error(
                fmt::format("'{}' is a parameter and the group of '{}': rename one", both,
                            taken.size() < name.size() ? name : taken));
        }
    }
    rest().parameters.push_back(parameter);
    own(parameter);
}

template <typename C>
void ComponentAccess<C>::end(const void* member) const {
    Component::Rest& of = rest();
    const auto is_it = [member](const auto& each) { return addressOf(each) == member; };
    // @return true if the list had it
    const auto take = [&](auto& list, const std::string& kind, const auto& name) {
        const auto found = std::find_if(list.begin(), list.end(), is_it);
        if (found == list.end()) return false;
        if (!of.frozen) of.ended.push_back(kind + name(*found));
        list.erase(found);
        return true;
    };
    const auto drop = [&](auto& list) {
        list.erase(std::remove_if(list.begin(), list.end(), is_it), list.end());
    };
    const auto of_port = [](const auto* port) { return " '" + port->name() + "'"; };
    const auto of_parameter = [](const auto* each) {
        return " '" + each->declaration().name + "'";
    };
    const auto of_state = [](const auto& state) { return " '" + state.name + "'"; };
    const auto none = [](const auto* /*each*/) { return std::string(); };
    if (take(of.inputs, "input", of_port)) {
        drop(of.input_ports);
    } else if (take(of.outputs, "output", of_port)) {
        drop(of.staged_outputs);
    } else {
        (void)(take(of.parameters, "parameter", of_parameter) ||
               take(of.states, "state", of_state) || take(of.derived, "a Derived", none) ||
               take(of.mailboxes, "a Mailbox", none));
    }
}

template <typename C>
void ComponentAccess<C>::declare(StateDeclaration state) const {
    requireDeclarable(state.name, "state");
    std::size_t size = state.size;
    for (const StateDeclaration& other : rest().states) {
        if (other.name == state.name)
            throw std::logic_error(fmt::format("state '{}' is declared twice", state.name));
        size += other.size;
    }
    if (size > kLargestState) {
        throw std::logic_error(
            fmt::format("state '{}': {} bytes of state are more than the {} "
                        "that a component may have",
                        state.name, size, kLargestState));
    }
    own(state.value);
    rest().states.push_back(std::move(state));
}

template <typename C>
template <typename T>
void ComponentAccess<C>::declarePort(std::vector<T*>& members, T* port) const {
    const std::string& name = port->name();
    requireDeclarable(name, "port");
    const auto taken = [&](const auto& list) {
        return std::any_of(list.begin(), list.end(),
                           [&](const auto* other) { return other->name() == name; });
    };
    if (taken(rest().inputs) || taken(rest().outputs))
        throw std::logic_error(fmt::format("port '{}' is declared twice", name));
    members.push_back(port);
}

}  // namespace rtcf
