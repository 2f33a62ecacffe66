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
        rest().input_ports.push_back(std::move(input));
    }
    void declare(OutputPort* output) const {
        declarePort(rest().outputs, output);
        if (output->staged()) rest().staged_outputs.push_back(output);
    }
    void declare(DerivedBase* derived) const { rest().derived.push_back(derived); }
    void declare(MailboxBase* mailbox) const { rest().mailboxes.push_back(mailbox); }
    void declare(StateDeclaration state) const;
    void declare(ParameterBase* parameter) const;
    /// Undoes the last declarations of parameters.
    void undeclareParameters(std::size_t count) const noexcept {
        rest().parameters.resize(rest().parameters.size() - count);
    }
    /// Rejects further declarations. After configure().
    void freeze() const noexcept { rest().frozen = true; }
    /// @}

   private:
    Component::Rest& rest() const noexcept { return *component_.rest_; }
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
