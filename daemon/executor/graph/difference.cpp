#include "graph/difference.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "common/error.hpp"
#include "graph/fitted_value.hpp"
#include "graph/inherited_parameters.hpp"

namespace rtcf::executor {

namespace {

// The reason for replacing a component; empty = it can stay.
std::string replacementReason(const Instance& present, const WantedComponent& wanted) {
    const ComponentDefinition& is = present.definition();
    const ComponentDefinition& shall = wanted.definition;
    if (is.package != shall.package || is.type != shall.type) {
        return fmt::format("{}/{} -> {}/{}", is.package, is.type, shall.package, shall.type);
    }
    if (present.library().path() != wanted.library) {
        return fmt::format("{} -> {}", present.library().path(), wanted.library);
    }
    if (wanted.anew) return "its library has changed";
    if (is.remaps != shall.remaps) return "other remaps";
    if (is.every != shall.every) return fmt::format("every {} -> {}", is.every, shall.every);
    if (shall.phase && *shall.phase != present.phase())
        return fmt::format("phase {} -> {}", present.phase(), *shall.phase);
    if (is.optional != shall.optional) return shall.optional ? "optional" : "not optional";
    return {};
}

// The parameters whose present value differs from the wanted one, with the wanted value.
// @param detail, fixed the changes as text, and whether one is of a fixed parameter
std::vector<std::pair<std::string, ParameterValue>> otherParameters(
    const Instance& present, const ComponentDefinition& shall, std::string& detail, bool& fixed) {
    std::vector<std::pair<std::string, ParameterValue>> others;
    const auto& declared = accessTo(present.component()).parameters();
    for (const auto& [name, value] : shall.parameters) {
        const bool known = std::any_of(declared.begin(), declared.end(),
                                       [&name = name](const ParameterBase* parameter) {
                                           return parameter->declaration().name == name;
                                       });
        if (!known)
            others.emplace_back(name, value);  // rejected later, with the list of known names
    }
    for (std::size_t i = 0; i < declared.size(); ++i) {
        const std::string& name = declared[i]->declaration().name;
        ParameterValue value = declared[i]->declaration().default_value;
        for (const auto& [given, given_value] : shall.parameters) {
            if (given == name) value = given_value;
        }
        ParameterValue checked = value;
        fit(declared[i]->declaration(), checked);
        const bool bad = !declared[i]->check(checked).empty();
        if (!bad && sameValue(checked, present.parameterValues()[i])) continue;
        detail += fmt::format("{}{} {} -> {}", detail.empty() ? "" : ", ", name,
                              parameterText(present.parameterValues()[i]), parameterText(value));
        others.emplace_back(name, value);
        fixed = fixed || declared[i]->declaration().fixed;
    }
    return others;
}

}  // namespace

std::vector<Difference> compare(const Graph& graph, const std::vector<WantedComponent>& wanted) {
    std::set<std::string> names;
    for (const WantedComponent& component : wanted) {
        if (names.insert(component.definition.fullName()).second) continue;
        throw Error(ErrorKind::ComponentTwice,
                    fmt::format("{} is in the graph twice", component.definition.fullName()));
    }
    std::vector<Difference> differences;
    for (const GraphNode& node : graph.nodes()) {
        const std::string& name = node.instance->fullName();
        if (names.count(name) == 0)
            differences.push_back({Difference::Kind::Unload, name, {}, nullptr, {}});
    }
    for (const WantedComponent& component : wanted) {
        const ComponentDefinition& shall = component.definition;
        const std::string name = shall.fullName();
        const GraphNode* node = graph.find(name);
        if (node == nullptr) {
            differences.push_back(
                {Difference::Kind::Load, name, shall.package + "/" + shall.type, &component, {}});
            continue;
        }
        if (const std::string reason = replacementReason(*node->instance, component);
            !reason.empty()) {
            differences.push_back({Difference::Kind::Replace, name, reason, &component, {}});
            continue;
        }
        std::string detail;
        bool fixed = false;
        auto parameters = otherParameters(*node->instance, shall, detail, fixed);
        if (fixed) {
            differences.push_back({Difference::Kind::Replace, name, detail, &component, {}});
            continue;
        }
        if (node->breaks != shall.breaks) {
            differences.push_back(
                {Difference::Kind::Breaks, name, "other loop breaks", &component, {}});
        }
        if (!parameters.empty()) {
            differences.push_back(
                {Difference::Kind::Parameters, name, detail, &component, std::move(parameters)});
        }
    }
    return differences;
}

}  // namespace rtcf::executor
